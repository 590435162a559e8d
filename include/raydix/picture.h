// Pictures: rendered views, and files to keep them in.
#pragma once

#include <raydix/camera.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

namespace raydix {

class Bvh;  // <raydix/bvh.h>

/// Linear RGB. pixels [height * width], rows from the top.
struct Picture {
    std::uint32_t width = 0, height = 0;
    std::vector<Vec3> pixels;
};

/// What a picture shows. A pixel whose ray hits nothing has the sky in `shaded`, `diffuse` and
/// `path`, white in `ao`, and black in `normal`, `depth` and `primitive`.
/// - `shaded`: grey surfaces under sky and sun with shadows; in closed rooms under a lamp at the
///   camera.
/// - `normal`: (n + 1) / 2 of the geometric normal, turned to the viewer. Spheres, capsules and
///   points have the normals of raydix/surface.h. User geometry has none that is known: in all
///   views its normal points against the ray.
/// - `depth`: distance along the view, from 1 at the nearest hit down to 1/10 at the farthest.
/// - `primitive`: a colour for each triangle or shape, and of a scene for each instance that shows
/// it.
/// - `ao`: the part of the sky that is open within ao_radius.
/// - `diffuse`: as `shaded`, with one bounce of light in place of the even sky.
/// - `steps`: the number of nodes that a ray visits, as a heat map. For a scene: of a ray that goes
///   alone, which may differ between instruction sets. For a tree: of that tree.
/// - `path`: path traced, as `diffuse` with up to eight bounces of light.
enum class View : std::uint32_t { shaded, normal, depth, primitive, ao, diffuse, steps, path };
[[nodiscard]] std::string_view view_name(View view);
/// Whether its colours are light, which a file with 8 bits shows after a tone curve: `shaded`,
/// `diffuse` and `path`.
[[nodiscard]] bool is_tone_mapped(View view);
/// Throws InputError that lists the known names.
[[nodiscard]] View view_from_name(std::string_view name);

struct RenderOptions {
    View view = View::shaded;
    std::uint32_t width = 1024, height = 768;  // each 1..16384
    // Rays per pixel that gather light, 1..4096. From 4 on a pixel has four primary rays, and this
    // is rounded up to a multiple of 4; below 4 it has one. 0: 64 for ao and path, 32 for diffuse,
    // 16 for shaded. No effect in the other views.
    int samples = 0;
    float ao_radius = 0.0f;  // 0: 5 % of the diagonal of the scene's box
    std::uint64_t seed = 1;
    int threads = 0;  // 0 to 1,024; 0: all the machine has
    // Called with the part done, 0 to 1, ascending: on any thread, one call at a time. What it
    // throws comes out of the render, and it is not called again.
    std::function<void(double)> progress;
};

/// Rays per pixel that gather light: `samples` as it is rounded, or what 0 stands for. 0 in views
/// that gather none.
[[nodiscard]] int light_samples(const RenderOptions& options);

/// Renders the scene as its last commit left it. A geometry or instance without any bit in its mask
/// is not seen. `shaded`, `ao`, `diffuse` and `path` gather light; a pixel of the other views has
/// one ray, through its center. The picture does not depend on the number of threads. Throws
/// InputError: a scene that was never committed, a camera that shows nothing, options out of range.
[[nodiscard]] Picture render(const Scene& scene, const Camera& camera,
                             const RenderOptions& options = {});
/// The same of a scene in double, wherever it lies: rays meet it in double. All views but `steps`;
/// that throws InputError.
[[nodiscard]] Picture render(const SceneD& scene, const CameraD& camera,
                             const RenderOptions& options = {});
/// Renders one tree over triangles. All views but `steps` show what they show of a scene of the one
/// mesh. Throws InputError for a tree of boxes or points, and as above.
[[nodiscard]] Picture render(const Bvh& bvh, const Camera& camera,
                             const RenderOptions& options = {});

/// Writes a .png or .exr file, by its extension. A .png has 8 bits sRGB, after a filmic curve if
/// `tone_map`, and is clamped. An .exr has linear floats. Throws InputError that names the file:
/// another extension, a side that is not 1 to 16,384, and as write_file of files.h does.
void save_picture(const std::filesystem::path& file, const Picture& picture, bool tone_map);

/// Reads a .png file, with 8 bits a channel, as linear values. Throws InputError that names the
/// file.
[[nodiscard]] Picture load_picture(const std::filesystem::path& file);

}  // namespace raydix
