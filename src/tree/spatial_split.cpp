#include "tree/spatial_split.h"

#include <algorithm>

#include "exec/parallel.h"
#include "tree/outward_box.h"

namespace raydix {
namespace {

/// Shorter extents are not divided: the scale would overflow.
constexpr float least_extent = 1e-30f;

/// References across no more planes than this on any axis are priced as their boxes, cut at the
/// planes: what slicing them would take off is less than a few bins. In small nodes that is much,
/// and all are sliced that are cut at all.
constexpr std::int32_t planes_of_small(std::uint32_t bins) {
    return bins >= max_spatial_bins ? 3 : bins >= 16 ? 1 : 0;
}
/// Of small references so many are priced, each for several.
constexpr std::uint32_t priced_references = 4096;

struct DoubleBox {
    Polygon::Point lo{infinity, infinity, infinity}, hi{-infinity, -infinity, -infinity};

    void add(const Polygon::Point& p) {
        for (std::size_t k = 0; k < 3; ++k) {
            lo[k] = std::min(lo[k], p[k]);
            hi[k] = std::max(hi[k], p[k]);
        }
    }
    void add(const Polygon& polygon, double room) {
        for (std::size_t i = 0; i < polygon.count; ++i) {
            const Polygon::Point& p = polygon.corners[i];
            add({p[0] - room, p[1] - room, p[2] - room});
            add({p[0] + room, p[1] + room, p[2] + room});
        }
    }
    /// Rounded outward; inside `within`, empty if they do not meet.
    [[nodiscard]] Aabb inside(const Aabb& within) const {
        if (!(lo[0] <= hi[0])) return empty_box();
        return {max_of(Vec3{round_down(lo[0]), round_down(lo[1]), round_down(lo[2])}, within.lo),
                min_of(Vec3{round_up(hi[0]), round_up(hi[1]), round_up(hi[2])}, within.hi)};
    }
};

float& coordinate(Vec3& p, std::size_t axis) { return (&p.x)[axis]; }
float coordinate(const Vec3& p, std::size_t axis) { return (&p.x)[axis]; }

/// What each side of a plane may hold of a reference's box.
CutReference halves(const SplitBox& reference, std::uint32_t axis, float plane) {
    CutReference sides{reference.box(), reference.box()};
    coordinate(sides.left.hi, axis) = plane;
    coordinate(sides.right.lo, axis) = plane;
    return sides;
}

float half_surface(const Aabb& box) {
    const Vec3 d = box.hi - box.lo;
    return (d.x * d.y + d.y * d.z) + d.z * d.x;
}

/// The union of boxes as (lo, -hi): the lesser of both, lane by lane.
struct LowCorners {
    Float4 lo = Float4::all(infinity), minus_hi = Float4::all(infinity);

    void add(const LowCorners& other) {
        lo = min_of(lo, other.lo);
        minus_hi = min_of(minus_hi, other.minus_hi);
    }
    [[nodiscard]] Aabb box() const {
        std::array<float, 4> l, h;
        lo.store(l.data());
        minus_hi.store(h.data());
        return {{l[0], l[1], l[2]}, {-h[0], -h[1], -h[2]}};
    }
};

/// Half the surfaces of three boxes, NaN of empty ones.
Float4 areas(const std::array<LowCorners, 3>& boxes) {
    Float4 x = boxes[0].lo + boxes[0].minus_hi, y = boxes[1].lo + boxes[1].minus_hi,
           z = boxes[2].lo + boxes[2].minus_hi, none = Float4::all(0);
    transpose(x, y, z, none);
    return (x * y + y * z) + z * x;
}

/// What the bins with one number hold on the three axes.
struct SpatialRow {
    std::array<LowCorners, 3> corners;
    std::array<std::uint32_t, 4> begins{}, ends{};

    void add(const SpatialRow& other) {
        for (std::size_t axis = 0; axis < 3; ++axis) corners[axis].add(other.corners[axis]);
        add_counts(other);
    }
    void add_counts(const SpatialRow& other) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            begins[axis] += other.begins[axis];
            ends[axis] += other.ends[axis];
        }
    }
};

/// Plane b of an axis lies between its bins b - 1 and b.
struct SpatialGrid {
    std::array<float, 4> origin{}, width{}, inverse{};
    std::uint32_t bins;

    SpatialGrid(const Aabb& box, std::uint32_t bin_count) : bins(bin_count) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            origin[axis] = coordinate(box.lo, axis);
            const float extent = coordinate(box.hi, axis) - origin[axis];
            if (!(extent >= least_extent)) continue;
            width[axis] = extent / static_cast<float>(bins);
            inverse[axis] = static_cast<float>(bins) / extent;
        }
    }
    [[nodiscard]] float plane(std::size_t axis, std::uint32_t b) const {
        return origin[axis] + width[axis] * static_cast<float>(b) + 0.0f;
    }
    /// Of a point inside the box.
    void bins_of(Float4 p, std::array<std::int32_t, 4>& bin) const {
        const Float4 at = (p - Float4::load(origin.data())) * Float4::load(inverse.data());
        min_of(at, Float4::all(static_cast<float>(bins - 1))).store_whole(bin.data());
    }
};

Float4 load_point(const Vec3& p) {
    const std::array<float, 4> xyz{p.x, p.y, p.z, 0};
    return Float4::load(xyz.data());
}

/// Corners of a triangle in ascending order on one axis, by which of them are below others: bit 0
/// the second below the first, bit 1 the third below the second, bit 2 the third below the first.
constexpr std::array<std::array<std::uint8_t, 3>, 8> ascending{
    {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}, {0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};

/// A triangle with its corners in the order of one axis, cut across it. In float, without care for
/// rounding: it is only asked what a plane would cost. No branches: nobody can guess the order.
class SlicedTriangle {
public:
    SlicedTriangle(const std::array<Float4, 3>& corners, float x0, float x1, float x2) {
        const std::array<float, 3> x{x0, x1, x2};
        const auto code = static_cast<std::size_t>(x1 < x0) |
                          static_cast<std::size_t>(x2 < x1) << 1 |
                          static_cast<std::size_t>(x2 < x0) << 2;
        const auto& order = ascending[code];
        const Float4 low = corners[order[0]], high = corners[order[2]];
        middle_ = corners[order[1]];
        middle_x_ = x[order[1]];
        long_ = Edge(low, high, x[order[0]], x[order[2]]);
        short_[0] = Edge(low, middle_, x[order[0]], middle_x_);
        short_[1] = Edge(middle_, high, middle_x_, x[order[2]]);
    }

    /// Where the plane meets the triangle, as a box. x lies between the first and last corner.
    [[nodiscard]] LowCorners section(float x) const {
        const Float4 a = long_.at(x), b = short_[x < middle_x_ ? 0 : 1].at(x);
        return {min_of(a, b), Float4::all(0) - max_of(a, b)};
    }
    [[nodiscard]] float middle_x() const { return middle_x_; }
    [[nodiscard]] LowCorners middle() const { return {middle_, Float4::all(0) - middle_}; }

private:
    struct Edge {
        Float4 from, step;
        float x = 0, inverse = 0;

        Edge() = default;
        Edge(Float4 a, Float4 b, float begin, float end)
            : from(a), step(b - a), x(begin), inverse(end > begin ? 1 / (end - begin) : 0) {}
        [[nodiscard]] Float4 at(float plane) const {
            return from + step * Float4::all((plane - x) * inverse);
        }
    };

    float middle_x_;
    Float4 middle_;
    Edge long_;
    std::array<Edge, 2> short_;
};

class SpatialBins {
public:
    SpatialBins(const SpatialGrid& grid, std::uint32_t stride)
        : grid_(grid),
          rows_(grid.bins),
          stride_(stride),
          small_planes_(planes_of_small(grid.bins)) {}

    /// Of the small ones about one in `stride` stands for all: what one of them adds to a box is
    /// little.
    void take(const ReferenceCutter& cutter, std::span<const SplitBox> references) {
        for (const SplitBox& reference : references) {
            const LowCorners box{Float4::load(&reference.lo.x).xyz(),
                                 Float4::load(&reference.minus_hi.x).xyz()};
            std::array<std::int32_t, 4> from, to;
            grid_.bins_of(box.lo, from);
            grid_.bins_of(Float4::all(0) - box.minus_hi, to);
            const std::int32_t planes =
                std::max({to[0] - from[0], to[1] - from[1], to[2] - from[2]});
            const bool small = planes <= small_planes_;
            if (small && !is_sampled(reference.first)) continue;
            const std::uint32_t stands_for = small ? stride_ : 1;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                SpatialRow& first = rows_[static_cast<std::size_t>(from[axis])];
                first.begins[axis] += stands_for;
                rows_[static_cast<std::size_t>(to[axis])].ends[axis] += stands_for;
                if (from[axis] == to[axis])
                    first.corners[axis].add(box);
                else if (small)
                    chop(box, axis, static_cast<std::uint32_t>(from[axis]),
                         static_cast<std::uint32_t>(to[axis]));
            }
            if (!small) slice(cutter.corners(reference), box, from, to);
        }
    }
    void add(const SpatialBins& other) {
        for (std::size_t b = 0; b < rows_.size(); ++b) rows_[b].add(other.rows_[b]);
    }

    [[nodiscard]] SpatialSplit best() const {
        std::array<Float4, max_spatial_bins> right_cost;
        SpatialRow side;
        for (std::uint32_t b = grid_.bins - 1; b > 0; --b) {
            side.add(rows_[b]);
            right_cost[b] = areas(side.corners) * Float4::of(side.ends.data());
        }
        side = {};
        Float4 cost = Float4::all(infinity), plane = Float4::all(0);
        for (std::uint32_t b = 1; b < grid_.bins; ++b) {
            side.add(rows_[b - 1]);
            const Float4 here =
                areas(side.corners) * Float4::of(side.begins.data()) + right_cost[b];
            const Mask4 better = here < cost;  // no for NaN
            cost = select(better, here, cost);
            plane = select(better, Float4::all(static_cast<float>(b)), plane);
        }
        std::array<float, 4> costs, planes;
        cost.store(costs.data());
        plane.store(planes.data());
        std::uint32_t axis = 0;
        for (std::uint32_t a = 1; a < 3; ++a)
            if (costs[a] < costs[axis]) axis = a;
        if (!(costs[axis] < infinity)) return {};
        return split_at(axis, static_cast<std::uint32_t>(planes[axis]), costs[axis]);
    }

private:
    /// One id of `stride_`, spread by the golden ratio: the choice is the reference's own.
    [[nodiscard]] bool is_sampled(std::uint32_t id) const {
        return id * 0x9E3779B9u <= ~std::uint32_t{0} / stride_;
    }
    /// Adds a box that reaches from bin `first` to bin `last`, cut at the planes between them.
    void chop(LowCorners box, std::size_t axis, std::uint32_t first, std::uint32_t last) {
        std::array<float, 4> lo, minus_hi;
        lo.fill(-infinity);
        minus_hi.fill(-infinity);
        for (; first < last; ++first) {
            lo[axis] = grid_.plane(axis, first + 1);
            minus_hi[axis] = -lo[axis];
            rows_[first].corners[axis].add(
                {box.lo, max_of(box.minus_hi, Float4::load(minus_hi.data()))});
            box.lo = max_of(box.lo, Float4::load(lo.data()));
        }
        rows_[last].corners[axis].add(box);
    }
    void slice(const std::array<Vec3, 3>& exact, const LowCorners& box,
               const std::array<std::int32_t, 4>& from, const std::array<std::int32_t, 4>& to) {
        const std::array<Float4, 3> corners{load_point(exact[0]), load_point(exact[1]),
                                            load_point(exact[2])};
        std::array<float, 4> lo, minus_hi;
        box.lo.store(lo.data());
        box.minus_hi.store(minus_hi.data());
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (from[axis] != to[axis])
                slice({corners, coordinate(exact[0], axis), coordinate(exact[1], axis),
                       coordinate(exact[2], axis)},
                      box, axis, lo[axis], -minus_hi[axis], static_cast<std::uint32_t>(from[axis]),
                      static_cast<std::uint32_t>(to[axis]));
    }
    /// Adds what each bin of [first, last] holds of a reference that reaches from lo to hi.
    void slice(const SlicedTriangle& triangle, const LowCorners& box, std::size_t axis, float lo,
               float hi, std::uint32_t first, std::uint32_t last) {
        const Float4 most = Float4::all(0) - box.minus_hi, minus_least = Float4::all(0) - box.lo;
        const auto inside = [&](const LowCorners& part) -> LowCorners {
            return {min_of(max_of(part.lo, box.lo), most),
                    min_of(max_of(part.minus_hi, box.minus_hi), minus_least)};
        };
        LowCorners before = inside(triangle.section(lo));
        for (std::uint32_t b = first; b < last; ++b) {
            const float plane = max_of(min_of(grid_.plane(axis, b + 1), hi), lo);
            const LowCorners behind = inside(triangle.section(plane));
            before.add(behind);
            rows_[b].corners[axis].add(before);
            before = behind;
        }
        before.add(inside(triangle.section(hi)));
        rows_[last].corners[axis].add(before);
        const float x = triangle.middle_x();
        if (x < lo || x > hi) return;
        const auto bin = static_cast<std::uint32_t>((x - grid_.origin[axis]) * grid_.inverse[axis]);
        rows_[std::min(std::max(bin, first), last)].corners[axis].add(inside(triangle.middle()));
    }

    [[nodiscard]] SpatialSplit split_at(std::uint32_t axis, std::uint32_t b, float cost) const {
        SpatialSplit split{cost, axis, grid_.plane(axis, b), 0, 0, {}, {}};
        LowCorners left, right;
        for (std::uint32_t k = 0; k < grid_.bins; ++k) {
            (k < b ? left : right).add(rows_[k].corners[axis]);
            if (k < b)
                split.left += rows_[k].begins[axis];
            else
                split.right += rows_[k].ends[axis];
        }
        split.left_box = left.box();
        split.right_box = right.box();
        return split;
    }

    const SpatialGrid& grid_;
    std::vector<SpatialRow> rows_;
    std::uint32_t stride_;
    std::int32_t small_planes_;
};

}  // namespace

CutReference ReferenceCutter::cut(const SplitBox& reference, std::uint32_t axis,
                                  float plane) const {
    if (!corners_.exact()) return cut_with_room(reference, axis, plane);
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
    const CutReference sides = halves(reference, axis, plane);
    CutReference parts{left.inside(sides.left), right.inside(sides.right)};
    if (is_empty(parts.left) && is_empty(parts.right)) parts.left = reference.box();
    return parts;
}

/// A corner that is off by rounding may be on the wrong side, and an edge nearly along the plane
/// meets it elsewhere: both sides reach beyond the plane by the room, and each box by as much.
CutReference ReferenceCutter::cut_with_room(const SplitBox& reference, std::uint32_t axis,
                                            float plane) const {
    const Polygon triangle = corners_.polygon(reference.first);
    const double room = corners_.room(triangle);
    DoubleBox left, right;
    left.add(clip(triangle, axis, plane + room, 1.0), room);
    right.add(clip(triangle, axis, plane - room, -1.0), room);
    const CutReference sides = halves(reference, axis, plane);
    CutReference parts{left.inside(sides.left), right.inside(sides.right)};
    if (is_empty(parts.left) && is_empty(parts.right)) parts.left = reference.box();
    return parts;
}

SpatialSplit find_spatial_split(const ReferenceCutter& cutter, std::span<const SplitBox> references,
                                const Aabb& box, std::uint32_t bins) {
    const SpatialGrid grid(box, bins);
    const auto n = static_cast<std::uint32_t>(references.size());
    const std::uint32_t stride = std::max(n / priced_references, 1u);
    if (references.size() < 2 * parallel_boxes) {
        SpatialBins all(grid, stride);
        all.take(cutter, references);
        return all.best();
    }
    // Minima and whole numbers: as exact in parts as at once.
    std::vector<SpatialBins> parts((n + parallel_boxes - 1) / parallel_boxes,
                                   SpatialBins(grid, stride));
    for_each_block(n, parallel_boxes, [&](std::size_t b, std::size_t begin, std::size_t end) {
        parts[b].take(cutter, references.subspan(begin, end - begin));
    });
    for (std::size_t b = 1; b < parts.size(); ++b) parts[0].add(parts[b]);
    return parts[0].best();
}

void SpatialSides::choose(const ReferenceCutter& cutter, std::span<const SplitBox> references,
                          const SpatialSplit& split) {
    Aabb left_box = split.left_box, right_box = split.right_box;
    std::uint32_t left = split.left, right = split.right;
    sides_.resize(references.size());
    cuts_.clear();
    left_count_ = right_count_ = 0;
    for (std::size_t k = 0; k < references.size(); ++k) {
        const SplitBox& reference = references[k];
        Side& side = sides_[k];
        if (-coordinate(reference.minus_hi, split.axis) <= split.plane) {
            side = left_side;
        } else if (coordinate(reference.lo, split.axis) >= split.plane) {
            side = right_side;
        } else {
            const Aabb with_left = unite(left_box, reference.box());
            const Aabb with_right = unite(right_box, reference.box());
            const auto l = static_cast<float>(left), r = static_cast<float>(right);
            const float area_left = half_surface(left_box), area_right = half_surface(right_box);
            const float divided = area_left * l + area_right * r;
            const float all_left = half_surface(with_left) * l + area_right * (r - 1);
            const float all_right = area_left * (l - 1) + half_surface(with_right) * r;
            side = all_left <= divided && all_left <= all_right ? left_side
                   : all_right <= divided                       ? right_side
                                                                : both_sides;
            if (side == both_sides) {
                const CutReference parts = cutter.cut(reference, split.axis, split.plane);
                if (is_empty(parts.right))
                    side = left_side;
                else if (is_empty(parts.left))
                    side = right_side;
                else
                    cuts_.push_back(parts);
            }
            if (side == left_side) {
                left_box = with_left;
                right -= std::min(right, 1u);  // they are estimates
            } else if (side == right_side) {
                right_box = with_right;
                left -= std::min(left, 1u);
            }
        }
        left_count_ += side != right_side ? 1 : 0;
        right_count_ += side != left_side ? 1 : 0;
    }
}

void SpatialSides::divide(std::span<const SplitBox> references, SplitBox* to_left,
                          SplitBox* to_right) const {
    auto cut = cuts_.begin();
    for (std::size_t k = 0; k < references.size(); ++k) {
        const SplitBox& reference = references[k];
        if (sides_[k] == left_side) {
            *to_left++ = reference;
        } else if (sides_[k] == right_side) {
            *to_right++ = reference;
        } else {
            *to_left++ = SplitBox::of(cut->left, reference.first, 1);
            *to_right++ = SplitBox::of(cut->right, reference.first, 1);
            ++cut;
        }
    }
}

}  // namespace raydix
