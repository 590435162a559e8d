// raydix/device_scene.h on a CUDA device: one launch on the caller's stream.
#include <raydix/device_scene.h>
#include <raydix/error.h>

#include "engine/name_hit.h"
#include "exec/cuda_launcher.cuh"
#include "gpu/cuda_backend.h"

namespace raydix {

void CudaBackend::name_hits(const DeviceMeshNames& names, std::span<const TreeHit> found,
                            std::span<Hit> hits, Stream stream) {
    static_cast<void>(name());  // says what is missing
    check_name_hits(found.size(), hits.size());
    if (found.size() >= 0x80000000u) throw InputError("2^31 hits or more in one launch");
    CudaLauncher launcher(static_cast<cudaStream_t>(stream), nullptr, CudaLauncher::reserved_bytes);
    launcher.launch(
        "scene.name", static_cast<std::uint32_t>(found.size()),
        NameHit{{names.first(), names.ids(), names.count()}, found.data(), hits.data()});
}

}  // namespace raydix
