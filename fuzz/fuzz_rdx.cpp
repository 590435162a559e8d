// Feeds bytes to the readers of .rdx files, of trees and of scenes. Checksums are made right first,
// else no input would get past them.
#include <raydix/error.h>
#include <raydix/surface.h>

#include <cmath>
#include <cstdlib>
#include <cstring>

#include "../tests/support/rdx_seal.h"
#include "io/rdx_parse.h"

namespace {

using namespace raydix;

/// What was accepted must bear being traced, changed and saved.
void use(RdxScene file) {
    const Aabb bounds = file.scene.bounds();
    std::vector<Ray> rays;
    for (int k = 0; k < 16; ++k) {
        const float x = 0.5f * static_cast<float>(k % 4), y = 0.5f * static_cast<float>(k / 4);
        rays.push_back({{bounds.lo.x, bounds.lo.y, bounds.lo.z}, 0, {1, x, y}});
        rays.push_back({{0.3f * x, 0.3f * y, -5}, 0, {0.01f * x, 0.02f * y, 1}});
    }
    const std::vector<Hit> hits = trace(file.scene, rays, {.threads = 1});
    std::vector<Vec3> points(hits.size());
    positions(file.scene, rays, hits, points, 1);
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (hits[i].hit() != any_hit(file.scene, rays[i])) std::abort();
    SceneOptions options = file.options;
    options.threads = 1;
    if (file.scene.commit(options).trees_built != 0) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::shared_ptr<void> owner = allocate_bytes(size);
    const std::span<std::byte> bytes(static_cast<std::byte*>(owner.get()), size);
    if (size != 0) std::memcpy(bytes.data(), data, size);
    if (size >= sizeof(rdx::HeaderStart)) test::seal_rdx(bytes);
    try {
        if (size >= sizeof(rdx::HeaderStart) &&
            rdx::version_of("fuzz.rdx", bytes) != rdx::version) {
            use(rdx::parse_scene("fuzz.rdx", bytes, owner));
        } else {
            const RdxFile file = rdx::parse("fuzz.rdx", bytes, owner);
            if (tree_stats(file.bvh).leaves != file.bvh.leaf_count()) std::abort();
        }
    } catch (const InputError&) {
        return 0;
    }
    return 0;
}
