// Collision detection: a knot flies through a cat that sways; both deform, so each frame both trees
// are refitted, or rebuilt once refitting has made them bad, and all pairs of triangles that meet
// are found.
//     example_collision [FOLDER] [WIDTH] [FRAMES] [TRIANGLES of each]
// Prints contacts and milliseconds of each frame; writes the frame with the most contacts, with the
// triangles in contact marked. Judged in every frame: two closed surfaces meet in closed curves;
// each pair of triangles is one segment of them, and each end of a segment is where an edge of one
// mesh goes through a triangle of the other, which segments on both sides of the edge share. So
// there are as many pairs as such crossings, which another query counts. And the pairs are those of
// trees built from scratch by another builder.
#include <raydix/bvh.h>
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/raydix.h>
#include <raydix/refit.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "show.h"

namespace example {
namespace {

using Pairs = std::vector<raydix::PrimitivePair>;
constexpr float pi = std::numbers::pi_v<float>;

double ms_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
}

/// A (2, 3) torus knot: a tube around a curve that winds twice about one axis and three times about
/// the other; `time` makes it breathe.
raydix::Mesh knot(int triangles, float time) {
    const int around = std::max(8, static_cast<int>(std::sqrt(triangles / 40.0)));
    const int along = std::max(24, triangles / (2 * around));
    const auto curve = [&](float s) -> Vec3 {
        const float a = 2 * pi * s, r = 0.42f + (0.16f + 0.03f * std::sin(time)) * std::cos(3 * a);
        return {r * std::cos(2 * a), r * std::sin(2 * a), 0.2f * std::sin(3 * a)};
    };
    raydix::Mesh mesh;
    for (int i = 0; i < along; ++i) {
        const float s = static_cast<float>(i) / static_cast<float>(along);
        const Vec3 middle = curve(s), ahead = unit(curve(s + 1e-3f) - curve(s - 1e-3f));
        const Vec3 out = unit(cross(ahead, {0.3f, 0.2f, 1})), side = cross(ahead, out);
        for (int j = 0; j < around; ++j) {
            const float b = 2 * pi * static_cast<float>(j) / static_cast<float>(around);
            mesh.vertices.push_back(middle + 0.08f * (std::cos(b) * out + std::sin(b) * side));
        }
    }
    const auto at = [&](int i, int j) {
        return static_cast<std::uint32_t>(i % along * around + j % around);
    };
    for (int i = 0; i < along; ++i)
        for (int j = 0; j < around; ++j) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
        }
    return mesh;
}

/// A mesh that moves, and its tree.
class Body {
public:
    explicit Body(raydix::Mesh at_start)
        : mesh(std::move(at_start)), tree(raydix::build_bvh(mesh, options)), refitter_(tree) {}

    /// Call after `mesh` has changed. Returns the quality of the refitted tree, whether it stayed
    /// or not.
    double update() {
        const raydix::RefitQuality quality = refitter_.refit(tree, mesh);
        rebuilt = quality.ratio > 1.15;
        if (rebuilt) {
            builder_.build(mesh, options, tree);
            refitter_ = raydix::Refitter(tree);
        }
        return quality.ratio;
    }

    raydix::Mesh mesh;
    raydix::Bvh tree;
    bool rebuilt = false;

private:
    static constexpr raydix::BuildOptions options{.builder = raydix::Builder::ploc};
    raydix::BvhBuilder builder_;
    raydix::Refitter refitter_;
};

/// Places where edges of `a` go through triangles of `b`: each edge once.
std::uint64_t edge_crossings(const raydix::Mesh& a, const raydix::Bvh& b) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    for (const raydix::Triangle& t : a.triangles)
        for (std::size_t k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
    std::ranges::sort(edges);
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    std::vector<raydix::Segment> segments;
    for (const auto& [from, to] : edges) segments.push_back({a.vertices[from], a.vertices[to]});
    return raydix::touch_all(b, segments).counts.found;
}

class Scene {
public:
    explicit Scene(int triangles)
        : cat_at_rest_(
              raydix::load_model("builtin:figure?triangles=" + std::to_string(triangles)).mesh()),
          box_(raydix::inspect(cat_at_rest_).bounds),
          triangles_(triangles),
          cat(cat_at_rest_),
          ring(knot(triangles, 0)) {}

    /// `part` of the way, 0 to 1.
    void move_to(float part) {
        const float turn = 5 * part, twist = 3.2f * std::sin(pi * part);
        for (std::size_t i = 0; i < cat_at_rest_.vertices.size(); ++i) {
            const Vec3 p = cat_at_rest_.vertices[i];
            const float high = (p.y - box_.lo.y) / (box_.hi.y - box_.lo.y);
            const float c = std::cos(twist * high * high), s = std::sin(twist * high * high);
            cat.mesh.vertices[i] = {c * p.x + s * p.z, p.y, c * p.z - s * p.x};
        }
        ring.mesh = knot(triangles_, 9 * part);
        const Vec3 middle = 0.5f * (box_.lo + box_.hi);
        const float c = std::cos(turn), s = std::sin(turn);
        for (Vec3& p : ring.mesh.vertices) {
            const Vec3 q{c * p.x + s * p.z, p.y, c * p.z - s * p.x};
            p = middle + q + Vec3{3.8f * part - 1.9f, -0.05f, 0.12f};
        }
    }
    [[nodiscard]] raydix::Picture picture(const Pairs& pairs, std::uint32_t width) const;

private:
    raydix::Mesh cat_at_rest_;
    raydix::Aabb box_;
    int triangles_;

public:
    Body cat, ring;
};

raydix::Picture Scene::picture(const Pairs& pairs, std::uint32_t width) const {
    raydix::Mesh all = cat.mesh;
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    const std::size_t ring_begin = all.triangles.size();
    all.vertices.insert(all.vertices.end(), ring.mesh.vertices.begin(), ring.mesh.vertices.end());
    for (const raydix::Triangle& t : ring.mesh.triangles)
        all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    std::vector<Vec3> colours(all.triangles.size(), Vec3{0.55f, 0.50f, 0.43f});
    std::fill(colours.begin() + static_cast<std::ptrdiff_t>(ring_begin), colours.end(),
              Vec3{0.10f, 0.32f, 0.50f});
    for (const raydix::PrimitivePair& pair : pairs)
        colours[pair.first] = colours[ring_begin + pair.second] = {0.95f, 0.08f, 0.03f};
    const auto floor = static_cast<std::uint32_t>(all.vertices.size());
    for (const Vec3 corner : {Vec3{-9, 0, -9}, Vec3{-9, 0, 9}, Vec3{9, 0, 9}, Vec3{9, 0, -9}})
        all.vertices.push_back(corner + Vec3{0, box_.lo.y, 0});
    all.triangles.push_back({floor, floor + 1, floor + 2});
    all.triangles.push_back({floor, floor + 2, floor + 3});
    colours.resize(all.triangles.size(), Vec3{0.36f, 0.36f, 0.35f});
    const raydix::Scene traced(all);
    Subject subject = subject_of(all, traced, colours);
    subject.size = 2;
    return show(subject, {"front", {1.5f, 2.1f, 3.6f}, {0.05f, 0.92f, 0}, {0, 1, 0}, 32}, width,
                width * 3 / 4, {0.5f, 0.9f, 0.6f});
}

int run(const std::filesystem::path& folder, std::uint32_t width, int frames, int triangles) {
    Scene scene(triangles);
    std::size_t most = 0, touching = 0;
    int wrong = 0, rebuilds = 0;
    double update_ms = 0, pairs_ms = 0;
    raydix::Picture best;
    for (int frame = 0; frame < frames; ++frame) {
        scene.move_to(static_cast<float>(frame) / static_cast<float>(frames - 1));
        auto start = std::chrono::steady_clock::now();
        const double cat_ratio = scene.cat.update(), ring_ratio = scene.ring.update();
        const double update = ms_since(start);
        start = std::chrono::steady_clock::now();
        const Pairs pairs =
            raydix::overlapping_pairs(scene.cat.tree, scene.ring.tree, {.narrow = true});
        const double find = ms_since(start);
        const std::uint64_t crossings = edge_crossings(scene.cat.mesh, scene.ring.tree) +
                                        edge_crossings(scene.ring.mesh, scene.cat.tree);
        const bool same = pairs == raydix::overlapping_pairs(raydix::build_bvh(scene.cat.mesh),
                                                             raydix::build_bvh(scene.ring.mesh),
                                                             {.narrow = true});
        wrong += crossings != pairs.size() || !same;
        rebuilds += scene.cat.rebuilt + scene.ring.rebuilt;
        update_ms += update, pairs_ms += find, touching += !pairs.empty();
        std::printf(
            "frame %3d: %5zu contacts, %5llu edge crossings; update %6.2f ms (quality %.2f%s"
            " %.2f%s), pairs %6.2f ms\n",
            frame, pairs.size(), static_cast<unsigned long long>(crossings), update, cat_ratio,
            scene.cat.rebuilt ? " rebuilt" : "", ring_ratio, scene.ring.rebuilt ? " rebuilt" : "",
            find);
        if (pairs.size() <= most) continue;
        most = pairs.size();
        best = scene.picture(pairs, width);
    }
    if (most != 0) raydix::save_picture(folder / "collision.png", best, true);
    std::printf(
        "%zu and %zu triangles: %zu of %d frames in contact, at most %zu contacts; mean "
        "update %.2f ms, %d rebuilds, pairs %.2f ms; %d frames wrong\n",
        scene.cat.mesh.triangles.size(), scene.ring.mesh.triangles.size(), touching, frames, most,
        update_ms / frames, rebuilds, pairs_ms / frames, wrong);
    return wrong == 0 && most > 100 && touching < static_cast<std::size_t>(frames) ? 0 : 1;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int width = argc > 2 ? std::atoi(argv[2]) : 128,
              frames = argc > 3 ? std::atoi(argv[3]) : 9,
              triangles = argc > 4 ? std::atoi(argv[4]) : 20'000;
    if (width < 16 || frames < 2 || triangles < 5000)
        return std::fprintf(stderr, "a width, 2 frames or more, 5000 triangles or more\n"), 2;
    return example::run(folder, static_cast<std::uint32_t>(width), frames, triangles);
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
