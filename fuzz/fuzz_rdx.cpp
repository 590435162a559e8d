// Feeds bytes to the readers of .rdx files, of trees and of scenes. Checksums are made right first,
// else no input would get past them.
#include <raydix/error.h>
#include <raydix/rdx.h>
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

/// The same in double, where loading builds the trees.
void use(RdxSceneD file) {
    const AabbD bounds = file.scene.bounds();
    std::vector<RayD> rays;
    for (int k = 0; k < 16; ++k) {
        const double x = 0.5 * (k % 4), y = 0.5 * (k / 4);
        rays.push_back({bounds.lo, 0, {1, x, y}});
        rays.push_back({{0.3 * x, 0.3 * y, -5}, 0, {0.01 * x, 0.02 * y, 1}});
    }
    const std::vector<HitD> hits = trace(file.scene, rays, {.threads = 1});
    std::vector<Vec3d> points(hits.size());
    positions(file.scene, rays, hits, points, 1);
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (hits[i].hit() != any_hit(file.scene, rays[i])) std::abort();
    SceneOptions options = file.options;
    options.threads = 1;
    if (file.scene.commit(options).trees_built != 0) std::abort();
}

/// The reader for this version of file.
void read(std::uint32_t version, std::span<const std::byte> bytes,
          const std::shared_ptr<void>& owner) {
    if (version == rdx::double_version) {
        use(rdx::parse_scene_double("fuzz.rdx", bytes, owner));
    } else if (version != rdx::version) {
        use(rdx::parse_scene("fuzz.rdx", bytes, owner));
    } else {
        const RdxFile file = rdx::parse("fuzz.rdx", bytes, owner);
        if (tree_stats(file.bvh).leaves != file.bvh.leaf_count()) std::abort();
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::shared_ptr<void> owner = allocate_bytes(size);
    const std::span<std::byte> bytes(static_cast<std::byte*>(owner.get()), size);
    if (size != 0) std::memcpy(bytes.data(), data, size);
    if (size >= sizeof(rdx::HeaderStart)) test::seal_rdx(bytes);
    try {
        const bool has_header = size >= sizeof(rdx::HeaderStart);
        read(has_header ? rdx::version_of("fuzz.rdx", bytes) : rdx::version, bytes, owner);
    } catch (const InputError&) {
        return 0;
    }
    return 0;
}
