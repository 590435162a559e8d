// All points within a radius or a box. Included once per instruction set.
#if defined(RAYDIX_POINTS_WITHIN_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_POINTS_WITHIN_H
#undef RAYDIX_POINTS_WITHIN_H
#else
#define RAYDIX_POINTS_WITHIN_H
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "points/lanes.h"
#include "points/nearest.h"
#include "points/point_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

template <class T, int Dim>
class Ball {
public:
    HWY_INLINE Ball(const T* center, T radius)
        : center_(center), r2_(hn::Set(Lanes<T>(), radius * radius)) {}

    HWY_INLINE std::uint32_t boxes_met(const PointNode<T, Dim>& node) const {
        return each_part<T>([&](std::uint32_t from) {
            return within(least_squared_distances(node, center_, from));
        });
    }
    HWY_INLINE std::uint32_t boxes_inside(const PointNode<T, Dim>& node) const {
        return each_part<T>([&](std::uint32_t from) {
            return within(greatest_squared_distances(node, center_, from));
        });
    }
    /// Bit i: point i is within; d2 [16], out.
    HWY_INLINE std::uint32_t points_in(const PointLeaf<T, Dim>& leaf, T* d2) const {
        return each_part<T>([&](std::uint32_t from) {
            const auto of_part = squared_distances(leaf, center_, from);
            hn::Store(of_part, Lanes<T>(), d2 + from);
            return within(of_part);
        });
    }

private:
    HWY_INLINE std::uint32_t within(hn::Vec<Lanes<T>> d2) const {
        return bits_of(Lanes<T>(), hn::Le(d2, r2_));
    }
    QueryLanes<T, Dim> center_;
    hn::Vec<Lanes<T>> r2_;
};

template <class T, int Dim>
class Window {
public:
    HWY_INLINE explicit Window(const T* box) : lo_(box), hi_(box + Dim) {}

    HWY_INLINE std::uint32_t boxes_met(const PointNode<T, Dim>& node) const {
        return compare([&](int d, std::uint32_t from) {
            return hn::And(hn::Le(lo_.at[d], hn::Load(Lanes<T>(), node.hi[d] + from)),
                           hn::Le(hn::Load(Lanes<T>(), node.lo[d] + from), hi_.at[d]));
        });
    }
    HWY_INLINE std::uint32_t boxes_inside(const PointNode<T, Dim>& node) const {
        return compare([&](int d, std::uint32_t from) {
            return hn::And(hn::Le(lo_.at[d], hn::Load(Lanes<T>(), node.lo[d] + from)),
                           hn::Le(hn::Load(Lanes<T>(), node.hi[d] + from), hi_.at[d]));
        });
    }
    HWY_INLINE std::uint32_t points_in(const PointLeaf<T, Dim>& leaf, T* d2) const {
        std::fill_n(d2, points_per_leaf, T{0});
        return compare([&](int d, std::uint32_t from) {
            const auto at = hn::Load(Lanes<T>(), leaf.at[d] + from);
            return hn::And(hn::Le(lo_.at[d], at), hn::Le(at, hi_.at[d]));
        });
    }

private:
    template <class Test>
    HWY_INLINE std::uint32_t compare(const Test& test) const {
        return each_part<T>([&](std::uint32_t from) {
            auto all = test(0, from);
            for (int d = 1; d < Dim; ++d) all = hn::And(all, test(d, from));
            return bits_of(Lanes<T>(), all);
        });
    }
    QueryLanes<T, Dim> lo_, hi_;
};

/// leaf(group, mask, d2) for each group with points in the region, in the order of the tree;
/// returns early, and false, once that says false. With `whole` children that lie inside entirely
/// are not entered: whole(points).
template <class T, int Dim, class Region, class Leaf, class Whole>
HWY_INLINE bool walk_region(const PointTreeView<T, Dim>& tree, const Region& region,
                            const Leaf& leaf, const Whole& whole) {
    constexpr bool skips_whole = !std::is_same_v<Whole, std::nullptr_t>;
    struct Frame {
        const PointNode<T, Dim>* node;
        std::uint32_t waiting;
    } frames[max_point_depth];
    Frame* frame = frames;
    const auto enter = [&](const PointNode<T, Dim>& node) HWY_ATTR {
        std::uint32_t met = region.boxes_met(node) & node.child_mask();
        if constexpr (skips_whole) {
            // Just above the groups the test would cost as much as it saves.
            std::uint32_t inside = node.is_bottom == 0 ? region.boxes_inside(node) & met : 0;
            met &= ~inside;
            for (; inside != 0; inside &= inside - 1) whole(node.points[std::countr_zero(inside)]);
        }
        *frame = {&node, met};
    };
    enter(tree.nodes[0]);
    for (;;) {
        if (frame->waiting == 0) {
            if (frame-- == frames) return true;
            continue;
        }
        const std::uint32_t below =
            frame->node->below + static_cast<std::uint32_t>(std::countr_zero(frame->waiting));
        frame->waiting &= frame->waiting - 1;
        if (frame->node->is_bottom == 0) {
            ++frame;
            enter(tree.nodes[below]);
            continue;
        }
        alignas(64) T d2[points_per_leaf];
        const PointLeaf<T, Dim>& group = tree.leaves[below];
        const std::uint32_t in = region.points_in(group, d2);
        if (!leaf(group, in, d2)) return false;
    }
}

/// Orders a row of points found: by id, or by (d2, id).
template <class T>
class RowOrder {
public:
    explicit RowOrder(bool by_distance) : by_distance_(by_distance) {}

    HWY_INLINE void sort(std::uint32_t* ids, T* d2, std::size_t n) {
        if (n <= by_rank)
            sort_by_rank(ids, d2, n);
        else
            sort_long(ids, d2, n);
    }

private:
    static constexpr std::size_t by_rank = 64;
    using Ids = hn::CappedTag<std::uint32_t, 16>;

    /// A row's place is the number of those before it. There is room for 16 more behind the row.
    HWY_INLINE void sort_by_rank(std::uint32_t* ids, T* d2, std::size_t n) {
        alignas(64) std::uint32_t from_ids[by_rank + 16];
        alignas(64) T from_d2[by_rank + 16];
        const std::size_t padded = (n + 15) / 16 * 16;
        for (std::size_t i = 0; i < n; ++i) {
            from_ids[i] = ids[i];
            from_d2[i] = d2[i];
        }
        for (std::size_t i = n; i < padded; ++i) {
            from_ids[i] = no_primitive;
            from_d2[i] = std::numeric_limits<T>::quiet_NaN();
        }
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t rank = by_distance_ ? rank_by_distance(from_ids, from_d2, i, n)
                                                  : rank_by_id(from_ids, from_ids[i], padded);
            ids[rank] = from_ids[i];
            d2[rank] = from_d2[i];
        }
    }
    static HWY_INLINE std::size_t rank_by_id(const std::uint32_t* ids, std::uint32_t id,
                                             std::size_t padded) {
        constexpr Ids d;
        std::size_t rank = 0;
        for (std::size_t i = 0; i < padded; i += hn::MaxLanes(d))
            rank += hn::CountTrue(d, hn::Lt(hn::Load(d, ids + i), hn::Set(d, id)));
        return rank;
    }
    static std::size_t rank_by_distance(const std::uint32_t* ids, const T* d2, std::size_t of,
                                        std::size_t n) {
        std::size_t rank = 0;
        for (std::size_t i = 0; i < n; ++i)
            rank += d2[i] < d2[of] || (d2[i] == d2[of] && ids[i] < ids[of]);
        return rank;
    }

    struct Found {
        T d2;
        std::uint32_t id;
    };
    void sort_long(std::uint32_t* ids, T* d2, std::size_t n) {
        row_.resize(n);
        for (std::size_t i = 0; i < n; ++i) row_[i] = {d2[i], ids[i]};
        if (by_distance_)
            std::sort(row_.begin(), row_.end(), [](const Found& a, const Found& b) {
                return a.d2 < b.d2 || (a.d2 == b.d2 && a.id < b.id);
            });
        else
            std::sort(row_.begin(), row_.end(),
                      [](const Found& a, const Found& b) { return a.id < b.id; });
        for (std::size_t i = 0; i < n; ++i) {
            ids[i] = row_[i].id;
            d2[i] = row_[i].d2;
        }
    }

    bool by_distance_;
    std::vector<Found> row_;
};

/// Bits of the points that are to be kept.
template <class T, int Dim>
HWY_INLINE std::uint32_t kept_of(const PointLeaf<T, Dim>& leaf, std::uint32_t in, KeepPoints keep,
                                 std::uint32_t itself) {
    if (keep == KeepPoints::all || in == 0) return in;
    constexpr hn::CappedTag<std::uint32_t, 16> d;
    const auto id = hn::Set(d, itself);
    std::uint32_t kept = 0;
    for (std::uint32_t from = 0; from < 16; from += static_cast<std::uint32_t>(hn::MaxLanes(d))) {
        const auto ids = hn::Load(d, leaf.id + from);
        const auto mask = keep == KeepPoints::others ? hn::Ne(ids, id) : hn::Gt(ids, id);
        kept |= bits_of(d, mask) << from;
    }
    return kept & in;
}

template <class Region, class T, int Dim>
constexpr std::uint32_t query_values = std::is_same_v<Region, Window<T, Dim>> ? 2 * Dim : Dim;

/// body(region, k, place) for each valid query; none(k, place) for the others.
template <class Region, class T, int Dim, class Body, class None>
HWY_INLINE void each_query(const WithinJob<T, Dim>& job, PointJobCounts& counts, const Body& body,
                           const None& none) {
    for (std::size_t k = 0; k < job.n; ++k) {
        const std::size_t place = job.place(k);
        const T* query = job.queries + place * query_values<Region, T, Dim>;
        bool valid = is_finite<T, Dim>(query);
        if constexpr (std::is_same_v<Region, Window<T, Dim>>)
            valid = valid && is_finite<T, Dim>(query + Dim);
        counts.invalid += !valid;
        if (!valid || job.tree.empty()) {
            none(place);
            continue;
        }
        if constexpr (std::is_same_v<Region, Window<T, Dim>>)
            body(Region(query), k, place);
        else
            body(Region(query, job.radius_of(place)), k, place);
    }
}

HWY_INLINE std::uint32_t bit_count(std::uint32_t bits) {
    return static_cast<std::uint32_t>(std::popcount(bits));
}

template <class Region, class T, int Dim>
void count_within(const WithinJob<T, Dim>& job, PointJobCounts& counts) {
    each_query<Region>(
        job, counts,
        [&](const Region& region, std::size_t k, std::size_t place) HWY_ATTR {
            std::uint32_t found = 0;
            if (job.keep == KeepPoints::later) {
                const auto leaf = [&](const PointLeaf<T, Dim>& group, std::uint32_t in,
                                      const T*) HWY_ATTR {
                    found += bit_count(kept_of(group, in, job.keep, job.itself[k]));
                    return true;
                };
                walk_region(job.tree, region, leaf, nullptr);
            } else {
                const auto leaf = [&](const PointLeaf<T, Dim>&, std::uint32_t in, const T*)
                                      HWY_ATTR {
                                          found += bit_count(in);
                                          return true;
                                      };
                walk_region(job.tree, region, leaf, [&](std::uint32_t n) { found += n; });
                found -= job.keep == KeepPoints::others;  // it is within any radius of itself
            }
            job.counts[place] = found;
            counts.found += found;
        },
        [&](std::size_t place) { job.counts[place] = 0; });
}

template <class Region, class T, int Dim>
void collect_within(const WithinJob<T, Dim>& job, FoundPoints<T>& found, PointJobCounts& counts) {
    RowOrder<T> order(job.by_distance);
    each_query<Region>(
        job, counts,
        [&](const Region& region, std::size_t k, std::size_t place) HWY_ATTR {
            if (found.size > job.most_found) return;
            const std::uint32_t itself = job.keep == KeepPoints::all ? 0 : job.itself[k];
            const std::size_t begin = found.size;
            walk_region(
                job.tree, region,
                [&](const PointLeaf<T, Dim>& group, std::uint32_t in, const T* d2) HWY_ATTR {
                    in = kept_of(group, in, job.keep, itself);
                    found.reserve(points_per_leaf);
                    for (; in != 0; in &= in - 1) {
                        const auto i = static_cast<std::uint32_t>(std::countr_zero(in));
                        found.ids[found.size] = group.id[i];
                        found.d2[found.size++] = d2[i];
                    }
                    return true;
                },
                nullptr);
            const std::size_t n = found.size - begin;
            if (n == 0) {
                job.counts[place] = 0;
                return;
            }
            T* d2 = found.d2.data() + begin;
            order.sort(found.ids.data() + begin, d2, n);
            for (std::size_t i = 0; i < n; ++i) d2[i] = std::sqrt(d2[i]);
            job.counts[place] = static_cast<std::uint32_t>(n);
            counts.found += n;
        },
        [&](std::size_t place) { job.counts[place] = 0; });
}

template <class T, int Dim>
bool visit_ball(const PointTreeView<T, Dim>& tree, const T* query, T radius,
                const PointVisitor<T>& visitor) {
    if (tree.empty() || !is_finite<T, Dim>(query)) return true;
    return walk_region(
        tree, Ball<T, Dim>(query, radius),
        [&](const PointLeaf<T, Dim>& group, std::uint32_t in, const T* d2) HWY_ATTR {
            for (; in != 0; in &= in - 1) {
                const auto i = static_cast<std::uint32_t>(std::countr_zero(in));
                if (!visitor.call(visitor.data, group.id[i], std::sqrt(d2[i]))) return false;
            }
            return true;
        },
        nullptr);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
