// raydix/device_scene.h in a build without CUDA: the call that would need it says so.
#include <raydix/device_scene.h>
#include <raydix/error.h>

#if !defined(RAYDIX_HAVE_CUDA)

namespace raydix {

void name_hits_on_device(const DeviceMeshNames&, std::span<const TreeHit>, std::span<Hit>, Stream) {
    throw BackendUnavailable("device cuda: this build of raydix has no CUDA");
}

}  // namespace raydix

#endif
