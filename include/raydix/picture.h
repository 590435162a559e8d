// Pictures: rendered views, and files to keep them in.
#pragma once

#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

namespace raydix {

/// Linear RGB, rows from the top. pixels [height * width].
struct Picture {
    std::uint32_t width = 0, height = 0;
    std::vector<Vec3> pixels;
};

enum class View : std::uint32_t { shaded, normal, depth, primitive, ao, diffuse, steps };
[[nodiscard]] std::string_view view_name(View view);
/// Throws InputError that lists the known names.
[[nodiscard]] View view_from_name(std::string_view name);

struct RenderOptions {
    View view = View::shaded;
    std::uint32_t width = 1024, height = 768;  // each 1..16384
    // Rays per pixel that gather light, 1..4096; 0: 64 for ao, 32 for diffuse, 16 for shaded.
    int samples = 0;
    float ao_radius = 0.0f;  // 0: 5 % of the box diagonal
    std::uint64_t seed = 1;
    int threads = 0;  // 0 to 1,024; 0: all the machine has
    // Called with the part done, 0..1, on any thread, one at a time, while others render; what it
    // throws ends the render, and it is not called again.
    std::function<void(double)> progress;
};

/// `shaded`: sun with shadow and sky over grey, a lamp at the camera in closed rooms; `normal`: (n
/// + 1) / 2 of the geometric normal turned to the viewer; `depth`: near white to far black;
/// `primitive`: one colour per triangle; `ao`: open part of the sky within the radius; `diffuse`:
/// one bounce; `steps`: node visits as a heat map. Deterministic for every thread count. Where a
/// ray hits nothing: sky for `shaded` and `diffuse`, white for `ao`, black for `normal`, `depth`
/// and `primitive`. Four primary rays per pixel in the views that gather light, one through its
/// centre in the others. The scene is shown as its last commit left it, instances in the world; a
/// geometry or instance without any bit in its mask is not seen. `primitive`: a triangle has a
/// colour for each instance that shows it. `steps`: nodes on the way of a ray that goes alone,
/// which may differ between instruction sets. Throws InputError: a scene that was never committed,
/// a camera that shows nothing, options out of range.
[[nodiscard]] Picture render(const Scene& scene, const Camera& camera,
                             const RenderOptions& options = {});
/// The same of one tree over triangles; all views but `steps`, which counts nodes of this tree,
/// show what those of a scene of the one mesh show. Throws InputError for a tree of boxes or
/// points.
[[nodiscard]] Picture render(const Bvh& bvh, const Camera& camera,
                             const RenderOptions& options = {});

/// Writes .png (8 bit sRGB, clamped after a filmic curve if `tone_map`) or .exr (linear float), by
/// extension. Throws InputError that names the file.
void save_picture(const std::filesystem::path& file, const Picture& picture, bool tone_map);

/// Reads an 8-bit RGB .png back as linear values.
[[nodiscard]] Picture load_picture(const std::filesystem::path& file);

}  // namespace raydix
