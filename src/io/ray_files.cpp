// Rays and hits to and from .npy files: what outside scripts exchange with a trace.
#include <raydix/rays.h>

#include <cstring>

#include "base/options.h"
#include "scene/npy.h"

namespace raydix {
namespace {

constexpr std::size_t ray_columns = 8;  // ox oy oz tmin dx dy dz tmax, as a Ray lies in memory
static_assert(sizeof(Ray) == ray_columns * sizeof(float));

}  // namespace

std::vector<Ray> load_rays(const std::filesystem::path& file) {
    const std::vector<float> values = load_npy(file, ray_columns);
    std::vector<Ray> rays(values.size() / ray_columns);
    if (!rays.empty())
        std::memcpy(static_cast<void*>(rays.data()), values.data(), rays.size() * sizeof(Ray));
    return rays;
}

void save_rays(const std::filesystem::path& file, std::span<const Ray> rays) {
    const std::uint64_t shape[] = {rays.size(), ray_columns};
    save_npy_bytes(file, "<f4", shape, std::as_bytes(rays));
}

void save_hits(const std::filesystem::path& file, std::span<const Hit> hits, HitFields fields) {
    check_enum("fields", fields, HitFields::scene);
    if (fields == HitFields::scene)
        save_npy(file, hits);
    else
        save_npy(file, std::span<const TreeHit>(std::vector<TreeHit>(hits.begin(), hits.end())));
}

void save_occluded(const std::filesystem::path& file, std::span<const std::uint8_t> occluded) {
    const std::uint64_t shape[] = {occluded.size()};
    save_npy_bytes(file, "|u1", shape, std::as_bytes(occluded));
}

void save_offsets(const std::filesystem::path& file, std::span<const std::uint64_t> offsets) {
    save_npy(file, offsets);
}

}  // namespace raydix
