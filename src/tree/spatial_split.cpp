#include "tree/spatial_split.h"

#include <algorithm>
#include <array>

#include "tree/outward_box.h"

namespace raydix {
namespace {

struct DoubleBox {
    Polygon::Point lo{infinity, infinity, infinity}, hi{-infinity, -infinity, -infinity};

    void add(const Polygon::Point& p) {
        for (std::size_t k = 0; k < 3; ++k) {
            lo[k] = std::min(lo[k], p[k]);
            hi[k] = std::max(hi[k], p[k]);
        }
    }
    /// Rounded outward; inside `within`, empty if they do not meet.
    [[nodiscard]] Aabb inside(const Aabb& within) const {
        if (!(lo[0] <= hi[0])) return empty_box();
        return {max_of(Vec3{round_down(lo[0]), round_down(lo[1]), round_down(lo[2])}, within.lo),
                min_of(Vec3{round_up(hi[0]), round_up(hi[1]), round_up(hi[2])}, within.hi)};
    }
};

float& coordinate(Vec3& p, std::uint32_t axis) { return (&p.x)[axis]; }
float coordinate(const Vec3& p, std::uint32_t axis) { return (&p.x)[axis]; }

struct Bin {
    GrowingBox box;
    std::uint32_t begins = 0, ends = 0;
};
using Bins = std::array<Bin, spatial_bins>;

/// The planes of one axis: plane b lies between bins b - 1 and b.
class BinAxis {
public:
    BinAxis(const Aabb& box, std::uint32_t axis)
        : origin_(coordinate(box.lo, axis)),
          width_((coordinate(box.hi, axis) - origin_) / static_cast<float>(spatial_bins)),
          inverse_(1 / width_) {}

    [[nodiscard]] bool usable() const { return width_ > 0 && inverse_ < infinity; }
    [[nodiscard]] float plane(std::uint32_t b) const {
        return origin_ + width_ * static_cast<float>(b) + 0.0f;
    }
    [[nodiscard]] std::uint32_t bin(float x) const {
        const float at = (x - origin_) * inverse_;
        return at < static_cast<float>(spatial_bins) ? static_cast<std::uint32_t>(at)
                                                     : spatial_bins - 1;
    }

private:
    float origin_, width_, inverse_;
};

Float4 load_point(const Vec3& p) {
    const std::array<float, 4> xyz{p.x, p.y, p.z, 0};
    return Float4::load(xyz.data());
}

/// A triangle with its corners in the order of one axis, cut across it. In float, without care for
/// rounding: it is only asked what a plane would cost.
class SlicedTriangle {
public:
    SlicedTriangle(std::array<Vec3, 3> v, std::uint32_t axis) {
        const auto order = [&](std::size_t i, std::size_t j) {
            if (coordinate(v[j], axis) < coordinate(v[i], axis)) std::swap(v[i], v[j]);
        };
        order(0, 1);
        order(1, 2);
        order(0, 1);
        for (std::size_t k = 0; k < 3; ++k) {
            x_[k] = coordinate(v[k], axis);
            v_[k] = load_point(v[k]);
        }
    }

    /// Where the plane meets the triangle, as a box. x lies between the first and last corner.
    [[nodiscard]] GrowingBox section(float x) const {
        const Float4 a = edge(0, 2, x), b = x < x_[1] ? edge(0, 1, x) : edge(1, 2, x);
        GrowingBox box;
        box.lo = min_of(a, b);
        box.hi = max_of(a, b);
        return box;
    }
    /// Adds the middle corner if it lies in [begin, end].
    void add_middle(float begin, float end, GrowingBox& box) const {
        if (!(x_[1] >= begin && x_[1] <= end)) return;
        box.lo = min_of(box.lo, v_[1]);
        box.hi = max_of(box.hi, v_[1]);
    }

private:
    [[nodiscard]] Float4 edge(std::size_t i, std::size_t j, float x) const {
        const float length = x_[j] - x_[i];
        const float t = length > 0 ? (x - x_[i]) / length : 0.0f;
        return v_[i] + (v_[j] - v_[i]) * Float4::all(t);
    }

    std::array<float, 3> x_;
    std::array<Float4, 3> v_;
};

/// Adds what each bin of [first, last] holds of a reference.
void add_slices(const SlicedTriangle& triangle, const SahReference& reference, const BinAxis& grid,
                std::uint32_t axis, std::uint32_t first, std::uint32_t last, Bins& bins) {
    const float lo = coordinate(reference.lo, axis), hi = coordinate(reference.hi, axis);
    const Float4 box_lo = Float4::load(&reference.lo.x).xyz(),
                 box_hi = Float4::load(&reference.hi.x).xyz();
    float begin = lo;
    GrowingBox before = triangle.section(begin);
    for (std::uint32_t b = first; b <= last; ++b) {
        const float end = b == last ? hi : std::clamp(grid.plane(b + 1), begin, hi);
        const GrowingBox behind = triangle.section(end);
        GrowingBox slice = before;
        slice.add(behind);
        triangle.add_middle(begin, end, slice);
        bins[b].box.lo = min_of(bins[b].box.lo, min_of(max_of(slice.lo, box_lo), box_hi));
        bins[b].box.hi = max_of(bins[b].box.hi, max_of(min_of(slice.hi, box_hi), box_lo));
        before = behind;
        begin = end;
    }
}

void fill_bins(const ReferenceCutter& cutter, const SahReference* references,
               std::span<const std::uint32_t> places, const BinAxis& grid, std::uint32_t axis,
               Bins& bins) {
    for (const std::uint32_t place : places) {
        const SahReference& reference = references[place];
        const std::uint32_t first = grid.bin(coordinate(reference.lo, axis));
        const std::uint32_t last = std::max(first, grid.bin(coordinate(reference.hi, axis)));
        ++bins[first].begins;
        ++bins[last].ends;
        if (first == last)
            bins[first].box.add(reference);
        else
            add_slices({cutter.corners(reference), axis}, reference, grid, axis, first, last, bins);
    }
}

void find_in_bins(const Bins& bins, const BinAxis& grid, std::uint32_t axis, std::uint32_t n,
                  SpatialSplit& best) {
    std::array<GrowingBox, spatial_bins> behind;
    GrowingBox box;
    for (std::uint32_t b = spatial_bins; b-- > 1;) {
        box.add(bins[b].box);
        behind[b] = box;
    }
    box = {};
    std::uint32_t left = 0, right = n;
    for (std::uint32_t b = 1; b < spatial_bins; ++b) {
        box.add(bins[b - 1].box);
        left += bins[b - 1].begins;
        right -= bins[b - 1].ends;
        if (left == 0 || right == 0) continue;
        const float cost =
            box.area() * static_cast<float>(left) + behind[b].area() * static_cast<float>(right);
        if (cost < best.cost)
            best = {cost, axis, grid.plane(b), left, right, box.box(), behind[b].box()};
    }
}

}  // namespace

CutReference ReferenceCutter::cut(const SahReference& reference, std::uint32_t axis,
                                  float plane) const {
    std::array<Polygon::Point, 3> v;
    const std::array<Vec3, 3> exact = corners(reference);
    for (std::size_t k = 0; k < 3; ++k) v[k] = {exact[k].x, exact[k].y, exact[k].z};
    DoubleBox left, right;
    for (std::size_t k = 0; k < 3; ++k) {
        const Polygon::Point &a = v[k], &b = v[k < 2 ? k + 1 : 0];
        const double from = a[axis] - plane, to = b[axis] - plane;
        if (from <= 0) left.add(a);
        if (from >= 0) right.add(a);
        if ((from < 0 && to > 0) || (from > 0 && to < 0)) {
            const double t = from / (from - to);
            Polygon::Point p;
            for (std::size_t i = 0; i < 3; ++i) p[i] = a[i] + t * (b[i] - a[i]);
            p[axis] = plane;
            left.add(p);
            right.add(p);
        }
    }
    Aabb low = reference.box(), high = low;
    coordinate(low.hi, axis) = plane;
    coordinate(high.lo, axis) = plane;
    CutReference parts{left.inside(low), right.inside(high)};
    if (is_empty(parts.left) && is_empty(parts.right)) parts.left = reference.box();
    return parts;
}

SpatialSplit find_spatial_split(const ReferenceCutter& cutter, const SahReference* references,
                                std::span<const std::uint32_t> places, const Aabb& box) {
    SpatialSplit best;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const BinAxis grid(box, axis);
        if (!grid.usable()) continue;
        Bins bins;
        fill_bins(cutter, references, places, grid, axis, bins);
        find_in_bins(bins, grid, axis, static_cast<std::uint32_t>(places.size()), best);
    }
    return best;
}

void choose_sides(const ReferenceCutter& cutter, const SahReference* references,
                  std::span<const std::uint32_t> places, const SpatialSplit& split,
                  SpatialSides& out) {
    Aabb left_box = split.left_box, right_box = split.right_box;
    std::uint32_t left = split.left, right = split.right;
    out.sides.resize(places.size());
    out.cut.clear();
    out.left_count = out.right_count = 0;
    for (std::size_t k = 0; k < places.size(); ++k) {
        const SahReference& reference = references[places[k]];
        SpatialSides::Side& side = out.sides[k];
        if (coordinate(reference.hi, split.axis) <= split.plane) {
            side = SpatialSides::left;
        } else if (coordinate(reference.lo, split.axis) >= split.plane) {
            side = SpatialSides::right;
        } else {
            const CutReference parts = cutter.cut(reference, split.axis, split.plane);
            const Aabb with_left = unite(left_box, reference.box());
            const Aabb with_right = unite(right_box, reference.box());
            const auto l = static_cast<float>(left), r = static_cast<float>(right);
            const float divided = sah_area(left_box) * l + sah_area(right_box) * r;
            const float all_left = sah_area(with_left) * l + sah_area(right_box) * (r - 1);
            const float all_right = sah_area(left_box) * (l - 1) + sah_area(with_right) * r;
            if (is_empty(parts.right) || (all_left <= divided && all_left <= all_right)) {
                side = SpatialSides::left;
                left_box = with_left;
                --right;
            } else if (is_empty(parts.left) || all_right <= divided) {
                side = SpatialSides::right;
                right_box = with_right;
                --left;
            } else {
                side = SpatialSides::both;
                out.cut.push_back(parts);
            }
        }
        out.left_count += side != SpatialSides::right ? 1 : 0;
        out.right_count += side != SpatialSides::left ? 1 : 0;
    }
}

void SideLists::cut(SahReference* references, std::span<const std::uint32_t> order,
                    const SpatialSides& sides, std::uint32_t free_places, std::uint8_t* side_of) {
    for (auto& parts : parts_) parts.clear();
    least_[0] = least_[1] = UINT32_MAX;
    std::size_t next_cut = 0;
    for (std::size_t k = 0; k < order.size(); ++k) {
        const std::uint32_t place = order[k];
        const SpatialSides::Side side = sides.sides[k];
        side_of[place] = side;
        const std::uint32_t id = references[place].primitive_id;
        if (side != SpatialSides::right) least_[0] = std::min(least_[0], id);
        if (side != SpatialSides::left) least_[1] = std::min(least_[1], id);
        if (side != SpatialSides::both) continue;
        const CutReference& parts = sides.cut[next_cut++];
        references[place] = make_reference(parts.left, id);
        references[free_places] = make_reference(parts.right, id);
        parts_[0].push_back(place);
        parts_[1].push_back(free_places++);
    }
}

std::uint32_t* SideLists::list(const SahReference* references, std::span<const std::uint32_t> order,
                               const std::uint8_t* side_of, SpatialSides::Side side,
                               std::uint32_t axis, std::uint32_t* out) {
    sorted_.clear();
    for (const std::uint32_t place : parts_[side]) sorted_.emplace_back(references, place, axis);
    std::sort(sorted_.begin(), sorted_.end());
    auto part = sorted_.begin();
    for (const std::uint32_t place : order) {
        if (side_of[place] != side) continue;
        if (part != sorted_.end()) {
            const KeyedPlace whole(references, place, axis);
            for (; part != sorted_.end() && *part < whole; ++part) *out++ = part->place;
        }
        *out++ = place;
    }
    for (; part != sorted_.end(); ++part) *out++ = part->place;
    return out;
}

}  // namespace raydix
