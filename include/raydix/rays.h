// Rays of the measuring protocol: primary, ambient occlusion, diffuse (Aila and Laine 2009 and its
// release).
#pragma once

#include <raydix/camera.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace raydix {

class Bvh;  // <raydix/bvh.h>

enum class RayKind : std::uint32_t { primary, ao, diffuse, diffuse_shuffled };
[[nodiscard]] std::string_view ray_kind_name(RayKind kind);

/// Makes one ray for each pixel, through its center, in 2-D Morton order of pixels (x in the lower
/// bit). Directions are of unit length. `pixels`, if not null, receives y * width + x of each ray.
/// Throws InputError that names the camera: it shows nothing, or a side is not 1 to 16,384.
[[nodiscard]] std::vector<Ray> make_primary_rays(const Camera& camera, std::uint32_t width,
                                                 std::uint32_t height,
                                                 std::vector<std::uint32_t>* pixels = nullptr);
[[nodiscard]] std::vector<RayD> make_primary_rays(const CameraD& camera, std::uint32_t width,
                                                  std::uint32_t height,
                                                  std::vector<std::uint32_t>* pixels = nullptr);

struct SecondaryOptions {
    RayKind kind = RayKind::ao;
    int samples = 32;        // rays per primary hit, 1..1024
    float ao_radius = 0.0f;  // tmax of ao rays; 0: 5 % of the box diagonal
    std::uint64_t seed = 1;  // of the per-pixel rotations
    // true: rays are sorted by a 6-D Morton key, one bit each of origin x y z and direction x y z a
    // level, from the highest on. Origins are scaled to 2^24 in the box of all end points;
    // directions are scaled to 2^21. Diffuse rays end for that at 1.5 times the largest side of the
    // scene's box, as in Aila and Laine's release. false: rays follow the hits, `samples` in a row.
    // diffuse_shuffled rays are permuted by `seed` in any case.
    bool sorted = true;
    int threads = 0;  // 0 to 1,024; 0: all the machine has
};

/// Makes `samples` rays from each of `hits`; misses give none. rays, hits, pixels [n] -> [hits *
/// samples] rays. Directions are Halton points (bases 2, 3), cosine-weighted about the geometric
/// normal that is turned toward the ray, and rotated by a hash of (pixel id, seed). Origins move
/// back along the primary ray by 3e-6 of the box's diagonal. The rays do not depend on the number
/// of threads. Throws InputError: sizes that differ, an option out of range, a hit on a primitive
/// that the tree does not hold.
[[nodiscard]] std::vector<Ray> make_secondary_rays(const Bvh& bvh, std::span<const Ray> rays,
                                                   std::span<const Hit> hits,
                                                   std::span<const std::uint32_t> pixels,
                                                   const SecondaryOptions& options);
/// The same from hits of a scene, as its last commit left it. A scene of one mesh gives the same
/// rays as its tree. Normals are those of raydix/surface.h, turned toward the ray: those of
/// spheres, capsules and points too. Throws InputError also if the scene was never committed, does
/// not have the path or the geometry of a hit, or knows no normal there, as of user geometry.
[[nodiscard]] std::vector<Ray> make_secondary_rays(const Scene& scene, std::span<const Ray> rays,
                                                   std::span<const Hit> hits,
                                                   std::span<const std::uint32_t> pixels,
                                                   const SecondaryOptions& options);

/// The same from hits in double. Origins have an error of 2^-24 of the scene's box's diagonal at
/// most, a fiftieth of the distance that they move back; directions are floats.
[[nodiscard]] std::vector<RayD> make_secondary_rays(const SceneD& scene, std::span<const RayD> rays,
                                                    std::span<const HitD> hits,
                                                    std::span<const std::uint32_t> pixels,
                                                    const SecondaryOptions& options);

/// NumPy files of shape (N, 8), float32: ox oy oz tmin dx dy dz tmax (docs/contract.md 5). Reading
/// takes float64 too and rounds it. Throws InputError that names the file.
[[nodiscard]] std::vector<Ray> load_rays(const std::filesystem::path& file);
void save_rays(const std::filesystem::path& file, std::span<const Ray> rays);

enum class HitFields : std::uint32_t {
    tree = 0,   // t, prim, u, v
    scene = 1,  // geometry and instance behind them
};

/// Writes a NumPy file of shape (N,) with named fields (docs/contract.md 9). Throws as write_file
/// of files.h.
void save_hits(const std::filesystem::path& file, std::span<const Hit> hits,
               HitFields fields = HitFields::tree);

/// Writes a NumPy file of shape (N,) uint8: what trace_any says of each ray.
void save_occluded(const std::filesystem::path& file, std::span<const std::uint8_t> occluded);

/// Writes a NumPy file of shape (N + 1,) uint64: where the hits of each of N rays begin, and the
/// end.
void save_offsets(const std::filesystem::path& file, std::span<const std::uint64_t> offsets);

}  // namespace raydix
