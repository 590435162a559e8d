// A plane through a tree: boxes it cuts as filled rectangles, level over level, then their edges,
// then the scene's own cut.
#include <raydix/error.h>
#include <raydix/tree_view.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "base/float_env.h"
#include "base/math.h"
#include "base/options.h"
#include "image/tree_picture.h"
#include "report/colour_map.h"
#include "report/picture_codec.h"

namespace raydix {
namespace {

constexpr double margin = 0.03;       // of the picture, on every side
constexpr double least_side = 5.0;    // pixels of a rectangle that gets edges
constexpr float point_slab = 0.005f;  // of the box: points this near to the plane are shown
constexpr Vec3 background{0.004f, 0.004f, 0.009f}, edge_colour{0.002f, 0.001f, 0.006f};
constexpr Vec3 scene_colour{0.95f, 0.97f, 1.0f};

float component_of(Vec3 v, std::uint32_t axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// The plane, and how it lies on the picture.
struct Slice {
    std::uint32_t axis, right, up;
    float at;
    double scale, left, bottom;  // pixels per unit; pixel of coordinate 0, up being negative y

    Slice(const Aabb& bounds, const SliceOptions& options)
        : axis(options.axis), right(axis == 0 ? 1 : 0), up(axis == 2 ? 1 : 2) {
        const float lo = component_of(bounds.lo, axis), hi = component_of(bounds.hi, axis);
        at = std::min(lo + options.at * (hi - lo), hi);
        const auto size = [&](std::uint32_t k) {
            return double(component_of(bounds.hi, k)) - component_of(bounds.lo, k);
        };
        const auto middle = [&](std::uint32_t k) {
            return 0.5 * (double(component_of(bounds.hi, k)) + component_of(bounds.lo, k));
        };
        const double room = 1 - 2 * margin;
        scale = std::min(room * options.width / std::max(size(right), 1e-30),
                         room * options.height / std::max(size(up), 1e-30));
        left = 0.5 * options.width - scale * middle(right);
        bottom = 0.5 * options.height + scale * middle(up);
    }
    [[nodiscard]] LineMask::End place(double u, double v) const {
        return {left + scale * u, bottom - scale * v, 1.0};
    }
    [[nodiscard]] LineMask::End place(Vec3 p) const {
        return place(component_of(p, right), component_of(p, up));
    }
    [[nodiscard]] bool cuts(const Aabb& box) const {
        return component_of(box.lo, axis) <= at && at <= component_of(box.hi, axis);
    }
};

/// A box on the picture: x0 <= x1 and y0 <= y1, in pixels.
struct Rectangle {
    double x0, y0, x1, y1;
    std::uint32_t level;
};

std::vector<Rectangle> cut_boxes(std::span<const LevelBox> boxes, const Slice& slice) {
    std::vector<Rectangle> cut;
    for (const LevelBox& b : boxes) {
        if (!slice.cuts(b.box)) continue;
        const LineMask::End lo = slice.place(b.box.lo), hi = slice.place(b.box.hi);
        cut.push_back({lo.x, hi.y, hi.x, lo.y, b.level});
    }
    std::stable_sort(cut.begin(), cut.end(),
                     [](const Rectangle& a, const Rectangle& b) { return a.level < b.level; });
    return cut;
}

void fill(Picture& picture, const Rectangle& r, Vec3 colour) {
    // Pixels whose centre lies inside; neighbours share no pixel and leave none out.
    const auto first = [](double x, std::uint32_t most) {
        return static_cast<std::uint32_t>(std::clamp(std::ceil(x - 0.5), 0.0, double(most)));
    };
    const std::uint32_t x0 = first(r.x0, picture.width), x1 = first(r.x1, picture.width),
                        y0 = first(r.y0, picture.height), y1 = first(r.y1, picture.height);
    for (std::uint32_t y = y0; y < y1; ++y)
        for (std::uint32_t x = x0; x < x1; ++x)
            picture.pixels[std::size_t{y} * picture.width + x] = colour;
}

double always(std::size_t, double) { return 1.0; }

/// Edges from the deepest level up, wider the higher the level.
void draw_edges(Picture& picture, const std::vector<Rectangle>& cut, const LevelScale& scale,
                double unit) {
    LineMask mask(picture.width, picture.height);
    for (auto end = cut.rbegin(); end != cut.rend();) {
        const std::uint32_t level = end->level;
        const float part = scale.part(level);
        const double wide = unit * (2.6 - 1.8 * double(part));
        mask.clear();
        for (; end != cut.rend() && end->level == level; ++end) {
            const Rectangle& r = *end;
            if (std::min(r.x1 - r.x0, r.y1 - r.y0) < least_side) continue;
            mask.add_line({r.x0, r.y0, 1}, {r.x1, r.y0, 1}, wide, always);
            mask.add_line({r.x1, r.y0, 1}, {r.x1, r.y1, 1}, wide, always);
            mask.add_line({r.x1, r.y1, 1}, {r.x0, r.y1, 1}, wide, always);
            mask.add_line({r.x0, r.y1, 1}, {r.x0, r.y0, 1}, wide, always);
        }
        blend(picture, mask, edge_colour, 0.85f - 0.35f * part);
    }
}

/// Where the plane cuts a triangle, as two ends.
std::optional<std::array<LineMask::End, 2>> cut_triangle(const LeafTriangle& t,
                                                         const Slice& slice) {
    const std::array<Vec3, 3> corners{t.v0, t.v1, t.v2};
    std::array<LineMask::End, 2> ends;
    std::size_t count = 0;
    for (std::size_t i = 0; i < 3 && count < 2; ++i) {
        const Vec3 a = corners[i], b = corners[(i + 1) % 3];
        const double from = double(component_of(a, slice.axis)) - slice.at,
                     to = double(component_of(b, slice.axis)) - slice.at;
        if ((from < 0) == (to < 0)) continue;
        const double part = from / (from - to);
        const auto mixed = [&](std::uint32_t k) {
            return component_of(a, k) + part * (double(component_of(b, k)) - component_of(a, k));
        };
        ends[count++] = slice.place(mixed(slice.right), mixed(slice.up));
    }
    if (count < 2) return {};
    return ends;
}

void draw_scene(Picture& picture, const Bvh& scene, const Slice& slice, double unit) {
    LineMask halo(picture.width, picture.height), line(picture.width, picture.height);
    for (const LeafTriangle& t : scene.triangles())
        if (const auto ends = cut_triangle(t, slice)) {
            halo.add_line((*ends)[0], (*ends)[1], 3.6 * unit, always);
            line.add_line((*ends)[0], (*ends)[1], 1.5 * unit, always);
        }
    const Aabb box = scene.bounds();
    const float reach =
        point_slab * (component_of(box.hi, slice.axis) - component_of(box.lo, slice.axis));
    for (const Vec3& p : scene.points()) {
        if (std::abs(component_of(p, slice.axis) - slice.at) > reach) continue;
        halo.add_line(slice.place(p), slice.place(p), 4.4 * unit, always);
        line.add_line(slice.place(p), slice.place(p), 2.2 * unit, always);
    }
    blend(picture, halo, edge_colour, 0.8f);
    blend(picture, line, scene_colour, 1.0f);
}

void check_options(const SliceOptions& options) {
    if (options.axis > 2)
        throw InputError("slice: axis " + std::to_string(options.axis) + "; it must be 0, 1 or 2");
    if (!(options.at >= 0.0f && options.at <= 1.0f))
        throw InputError("slice: place " + number_text(options.at) + "; it must be 0 to 1");
    for (const std::uint32_t side : {options.width, options.height})
        if (side < 1 || side > max_picture_side)
            throw InputError("slice: a picture of " + std::to_string(options.width) + " x " +
                             std::to_string(options.height) + " pixels; each side must be 1.." +
                             std::to_string(max_picture_side));
}

}  // namespace

Picture render_slice(const Bvh& scene, std::span<const LevelBox> boxes,
                     const SliceOptions& options) {
    const FloatEnvironment plain;
    check_options(options);
    Picture picture{options.width, options.height, {}};
    picture.pixels.assign(std::size_t{options.width} * options.height, background);
    if (scene.empty()) return picture;
    const Slice slice(scene.bounds(), options);
    const double unit = std::max(0.5, std::min(options.width, options.height) / 768.0);
    const std::vector<Rectangle> cut = cut_boxes(boxes, slice);
    const LevelScale scale(boxes);
    for (const Rectangle& r : cut)
        fill(picture, r, heat_colour(0.14f + 0.82f * scale.part(r.level)));
    draw_edges(picture, cut, scale, unit);
    draw_scene(picture, scene, slice, unit);
    return picture;
}

}  // namespace raydix
