// Real-time ray tracing: everything moves, so each frame commits new vertices to a moving scene and
// traces it. A cat turns its head and looks back, the ground is waves.
//     example_deforming_scene [FOLDER] [WIDTH] [FRAMES] [TRIANGLES]
// Prints milliseconds of each frame; writes the first and the last picture. Checks that a
// scene from scratch has the same hits after the last frame.
#include <raydix/raydix.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "vec.h"

namespace example {
namespace {

using raydix::Hit;
using raydix::Ray;

constexpr float pi = std::numbers::pi_v<float>;
constexpr int waves_per_side = 192;

double ms_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

/// The cat at rest, then a grid of the ground; one deformed mesh for all frames.
class MovingScene {
public:
    explicit MovingScene(int triangles)
        : rest_(
              raydix::load_model("builtin:figure?triangles=" + std::to_string(triangles)).mesh()) {
        box_ = raydix::inspect(rest_).bounds;
        cat_vertices_ = rest_.vertices.size(), cat_triangles_ = rest_.triangles.size();
        const auto first = static_cast<std::uint32_t>(cat_vertices_);
        for (int i = 0; i <= waves_per_side; ++i)
            for (int j = 0; j <= waves_per_side; ++j)
                rest_.vertices.push_back({8.0f * static_cast<float>(i) / waves_per_side - 4.0f,
                                          box_.lo.y,
                                          8.0f * static_cast<float>(j) / waves_per_side - 4.0f});
        constexpr std::uint32_t row = waves_per_side + 1;
        for (std::uint32_t i = 0; i < waves_per_side; ++i)
            for (std::uint32_t j = 0; j < waves_per_side; ++j) {
                const std::uint32_t a = first + i * row + j;
                rest_.triangles.push_back({a, a + 1, a + row});
                rest_.triangles.push_back({a + 1, a + row + 1, a + row});
            }
        now_ = rest_;
    }

    /// `time` in seconds.
    void move_to(float time) {
        const float turn = 1.9f * std::sin(0.5f * pi * time);
        const float lean = 0.25f * std::sin(pi * time);
        for (std::size_t i = 0; i < rest_.vertices.size(); ++i)
            now_.vertices[i] = i < cat_vertices_ ? twisted(rest_.vertices[i], turn, lean)
                                                 : waved(rest_.vertices[i], time);
    }

    [[nodiscard]] const raydix::Mesh& mesh() const { return now_; }
    [[nodiscard]] bool is_cat(std::uint32_t prim) const { return prim < cat_triangles_; }
    [[nodiscard]] Vec3 normal_of(std::uint32_t prim) const {
        const raydix::Triangle& t = now_.triangles[prim];
        const Vec3 a = now_.vertices[t[0]];
        return unit(cross(now_.vertices[t[1]] - a, now_.vertices[t[2]] - a));
    }

private:
    /// Twice the height, twice the angle, from the middle up; and a shear to one side.
    [[nodiscard]] Vec3 twisted(Vec3 p, float turn, float lean) const {
        const float height = (p.y - box_.lo.y) / (box_.hi.y - box_.lo.y);
        const float part = std::clamp(1.8f * (height - 0.3f), 0.0f, 1.0f);
        const float angle = turn * part * part * (3 - 2 * part);
        const float c = std::cos(angle), s = std::sin(angle);
        return {c * p.x + s * p.z + lean * height * height, p.y, c * p.z - s * p.x};
    }
    /// Rings around the cat, and a swell from one side.
    [[nodiscard]] static Vec3 waved(Vec3 p, float time) {
        const float r = std::sqrt(p.x * p.x + p.z * p.z);
        const float calm = std::clamp(r - 0.9f, 0.0f, 1.0f);  // the cat keeps its feet dry
        const float rings = 0.05f * std::sin(7.0f * r - 2 * pi * time) / (0.5f + 0.5f * r);
        const float swell = 0.06f * std::sin(1.7f * p.x + 1.1f * p.z + pi * time);
        return {p.x, p.y + calm * (rings + swell), p.z};
    }

    raydix::Mesh rest_, now_;
    raydix::Aabb box_;
    std::size_t cat_vertices_ = 0, cat_triangles_ = 0;
};

/// Sun with shadow, sky by the slope of the surface. The camera stands still: its rays are made
/// once.
class Renderer {
public:
    Renderer(std::uint32_t width, std::uint32_t height) : picture{width, height, {}} {
        const raydix::Camera camera{"front", {1.2f, 1.9f, 4.3f}, {0, 0.75f, 0}, {0, 1, 0}, 36};
        rays_ = raydix::make_primary_rays(camera, width, height, &pixels_);
        hits_.resize(rays_.size());
        picture.pixels.resize(rays_.size());
    }

    void render(const MovingScene& scene, const raydix::Scene& committed) {
        raydix::trace(committed, rays_, hits_);
        shadow_rays_.clear(), lit_.clear();
        for (std::size_t i = 0; i < rays_.size(); ++i) shade(scene, rays_[i], hits_[i], pixels_[i]);
        hidden_.resize(shadow_rays_.size());
        raydix::trace_any(committed, shadow_rays_, hidden_);
        for (std::size_t k = 0; k < hidden_.size(); ++k)
            if (hidden_[k] == 0) picture.pixels[lit_[k].pixel] += lit_[k].light;
    }

    /// Whether another scene gives the rays of the camera the hits of the last picture.
    [[nodiscard]] bool sees_the_same(const raydix::Scene& other) const {
        const std::vector<Hit> hits = raydix::trace(other, rays_);
        return std::memcmp(hits.data(), hits_.data(), hits.size() * sizeof(Hit)) == 0;
    }

    [[nodiscard]] double part_hit() const {
        const auto hit = std::ranges::count_if(hits_, [](const Hit& h) { return h.hit(); });
        return static_cast<double>(hit) / static_cast<double>(hits_.size());
    }

    raydix::Picture picture;

private:
    void shade(const MovingScene& scene, const Ray& ray, const Hit& hit, std::uint32_t pixel) {
        const Vec3 sun = unit({0.55f, 0.75f, 0.5f});
        if (!hit.hit()) {
            const float up = std::clamp(0.5f + ray.direction.y, 0.0f, 1.0f);
            picture.pixels[pixel] =
                up * Vec3{0.30f, 0.48f, 0.80f} + (1 - up) * Vec3{0.9f, 0.8f, 0.7f};
            return;
        }
        Vec3 normal = scene.normal_of(hit.prim);
        if (dot(normal, ray.direction) > 0) normal = -1.0f * normal;
        const Vec3 colour =
            scene.is_cat(hit.prim) ? Vec3{0.80f, 0.42f, 0.17f} : Vec3{0.10f, 0.30f, 0.34f};
        const float up = 0.5f + 0.5f * normal.y;
        picture.pixels[pixel] =
            colour * (up * Vec3{0.24f, 0.30f, 0.40f} + (1 - up) * Vec3{0.14f, 0.12f, 0.10f});
        const float cosine = dot(normal, sun);
        if (cosine <= 0) return;
        const Vec3 place = ray.origin + hit.t * ray.direction;
        shadow_rays_.push_back({place + 1e-4f * normal, 0, sun});
        Vec3 light = cosine * colour * Vec3{1.0f, 0.93f, 0.8f};
        if (!scene.is_cat(hit.prim)) {  // water glitters
            const Vec3 back = ray.direction - 2 * dot(ray.direction, normal) * normal;
            light += std::pow(std::max(0.0f, dot(back, sun)), 80.0f) * Vec3{2.0f, 1.8f, 1.4f};
        }
        lit_.push_back({pixel, light});
    }

    struct Lit {
        std::uint32_t pixel;
        Vec3 light;
    };
    std::vector<Ray> rays_, shadow_rays_;
    std::vector<std::uint32_t> pixels_;
    std::vector<Hit> hits_;
    std::vector<Lit> lit_;
    std::vector<std::uint8_t> hidden_;
};

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

int run(const std::filesystem::path& folder, int width, int frames, int triangles) {
    MovingScene scene(triangles);
    Renderer renderer(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(width * 3 / 4));
    raydix::Scene traced;
    const std::uint32_t id = traced.add(scene.mesh());
    const raydix::SceneOptions options{.usage = raydix::Usage::moving};
    std::vector<double> commit_ms, render_ms;
    std::uint64_t built = 0, refitted = 0;
    for (int frame = 0; frame < frames; ++frame) {
        scene.move_to(static_cast<float>(frame) / 24.0f);
        auto start = std::chrono::steady_clock::now();
        traced.update(id, scene.mesh());
        const raydix::CommitReport report = traced.commit(options);
        commit_ms.push_back(ms_since(start));
        built += report.trees_built, refitted += report.trees_refitted;
        start = std::chrono::steady_clock::now();
        renderer.render(scene, traced);
        render_ms.push_back(ms_since(start));
        std::printf("frame %3d: commit %6.2f ms (%s), render %6.2f ms, %4.1f %% of pixels hit\n",
                    frame, commit_ms.back(), report.trees_refitted != 0 ? "refit" : "build",
                    render_ms.back(), 100 * renderer.part_hit());
        if (frame == 0)
            raydix::save_picture(folder / "deforming_first.png", renderer.picture, true);
    }
    raydix::save_picture(folder / "deforming_last.png", renderer.picture, true);
    const bool same = renderer.sees_the_same(raydix::Scene(scene.mesh()));
    const double commit = median(commit_ms), render = median(render_ms);
    std::printf(
        "%zu triangles, %d x %d, shadows: median commit %.2f ms, render %.2f ms, %.1f frames/s\n",
        scene.mesh().triangles.size(), width, width * 3 / 4, commit, render,
        1000 / (commit + render));
    std::printf("trees built %llu times, refitted %llu times; a scene from scratch has %s hits\n",
                static_cast<unsigned long long>(built), static_cast<unsigned long long>(refitted),
                same ? "the same" : "OTHER");
    return same && built + refitted != 0 && renderer.part_hit() > 0.3 ? 0 : 1;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int width = argc > 2 ? std::atoi(argv[2]) : 256,
              frames = argc > 3 ? std::atoi(argv[3]) : 12;
    const int triangles = argc > 4 ? std::atoi(argv[4]) : 50'000;
    if (width < 4 || frames < 1) return std::fprintf(stderr, "a width, a number of frames\n"), 2;
    return example::run(folder, width, frames, triangles);
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
