// All points within a radius or a box. Included once per instruction set.
#if defined(RAYDIX_POINTS_RANGE_QUERY_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_POINTS_RANGE_QUERY_H
#undef RAYDIX_POINTS_RANGE_QUERY_H
#else
#define RAYDIX_POINTS_RANGE_QUERY_H
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "points/found_point.h"
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

HWY_INLINE std::uint32_t bit_count(std::uint32_t bits) {
    return static_cast<std::uint32_t>(std::popcount(bits));
}

/// The points of one row as they are found, and then in order.
template <class T>
class FoundRow {
    using D = Lanes<T>;
    using Ids = hn::CappedTag<std::uint32_t, 16>;

public:
    explicit FoundRow(ResultBudget* budget)
        : d2_(BudgetAllocator<T>(budget)),
          ids_(BudgetAllocator<std::uint32_t>(budget)),
          long_(BudgetAllocator<FoundPoint<T>>(budget)),
          spare_(BudgetAllocator<FoundPoint<T>>(budget)) {}

    HWY_INLINE void clear() { size_ = 0; }
    [[nodiscard]] std::size_t size() const { return size_; }
    /// Room for a row that is known to be so long; what was found is lost.
    HWY_INLINE void clear_for(std::size_t points) {
        clear();
        const std::size_t room = points + 2 * points_per_leaf;
        if (room > room_) grow_to(std::max(room, 2 * room_));
    }

    /// Points of a group whose bits are set.
    template <int Dim>
    HWY_INLINE void add(const PointLeaf<T, Dim>& group, std::uint32_t in, const T* d2) {
        if (size_ + 2 * points_per_leaf > room_) grow();
        constexpr D d;
        constexpr Ids i;
        std::size_t at = size_;
        for (std::uint32_t from = 0; from < 16; from += lanes_of<T>) {
            const std::uint32_t bits = in >> from & ((1u << lanes_of<T>)-1);
            hn::StoreU(compress(d, hn::Load(d, d2 + from), bits), d, &d2_[at]);
            at += bit_count(bits);
        }
        at = size_;
        constexpr auto id_lanes = static_cast<std::uint32_t>(hn::MaxLanes(i));
        for (std::uint32_t from = 0; from < 16; from += id_lanes) {
            const std::uint32_t bits = in >> from & ((1u << id_lanes) - 1);
            hn::StoreU(compress(i, hn::Load(i, group.id + from), bits), i, &ids_[at]);
            at += bit_count(bits);
        }
        size_ = at;
    }

    /// By id, or by (d2, id); distances are true ones unless the job wants squares. Not for an
    /// empty row.
    template <int Dim>
    HWY_INLINE void write(const WithinJob<T, Dim>& job, std::uint32_t* ids, T* distances) {
        if (size_ > most_ranked)
            write_long(job.by_distance, ids, distances);
        else if (job.by_distance)
            write_ranked<true>(ids, distances);
        else
            write_ranked<false>(ids, distances);
        if (!job.squared) take_roots(distances);
    }

private:
    static constexpr std::size_t most_ranked = 64;

    HWY_NOINLINE void grow() {
        const std::size_t room = 2 * room_ + 256;
        d2_.resize(room);
        ids_.resize(room);
        room_ = room;
    }
    HWY_NOINLINE void grow_to(std::size_t room) {
        room_ = 0;
        renew(d2_, room);
        renew(ids_, room);
        room_ = room;
    }
    /// The old memory goes back first.
    template <class List>
    static void renew(List& list, std::size_t size) {
        list = List(list.get_allocator());
        list.resize(size);
    }

    /// A point's place is the number of those before it.
    template <bool by_distance>
    HWY_INLINE void write_ranked(std::uint32_t* ids, T* distances) {
        constexpr Ids i;
        for (std::size_t from = 0; from < 16; from += hn::MaxLanes(i))
            hn::StoreU(hn::Set(i, no_primitive), i, &ids_[size_ + from]);
        for (std::size_t k = 0; k < size_; ++k) {
            const std::size_t rank =
                by_distance ? rank_by_distance(d2_[k], ids_[k]) : rank_by_id(ids_[k]);
            ids[rank] = ids_[k];
            distances[rank] = d2_[k];
        }
    }
    HWY_INLINE void take_roots(T* distances) const {
        constexpr D d;
        std::size_t k = 0;
        for (; k + lanes_of<T> <= size_; k += lanes_of<T>)
            hn::StoreU(hn::Sqrt(hn::LoadU(d, distances + k)), d, distances + k);
        for (; k < size_; ++k) distances[k] = std::sqrt(distances[k]);
    }
    /// Behind the last stand ids that are greater than any.
    HWY_INLINE std::size_t rank_by_id(std::uint32_t id) const {
        constexpr Ids i;
        std::size_t rank = 0;
        for (std::size_t k = 0; k < size_; k += hn::MaxLanes(i))
            rank += hn::CountTrue(i, hn::Lt(hn::LoadU(i, &ids_[k]), hn::Set(i, id)));
        return rank;
    }
    HWY_INLINE std::size_t rank_by_distance(T d2, std::uint32_t id) const {
        std::size_t rank = 0;
        for (std::size_t k = 0; k < size_; ++k)
            rank += d2_[k] < d2 || (d2_[k] == d2 && ids_[k] < id);
        return rank;
    }

    HWY_NOINLINE void write_long(bool by_distance, std::uint32_t* ids, T* distances) {
        if (long_.capacity() < size_) renew(long_, std::max(size_, 2 * long_.capacity()));
        long_.resize(size_);
        for (std::size_t k = 0; k < size_; ++k) long_[k] = {d2_[k], ids_[k]};
        by_distance ? sort_by_distance(long_) : sort_by_id(long_, spare_);
        for (std::size_t k = 0; k < size_; ++k) {
            ids[k] = long_[k].id;
            distances[k] = long_[k].d2;
        }
    }

    std::size_t size_ = 0, room_ = 0;
    BudgetVector<T> d2_;
    BudgetVector<std::uint32_t> ids_;
    BudgetVector<FoundPoint<T>> long_, spare_;
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

/// The row of query k of a job, behind nothing; of one that holds more than `most` points a part
/// that does too.
template <class Region, class T, int Dim>
HWY_INLINE void find_row(const WithinJob<T, Dim>& job, const Region& region, std::size_t k,
                         std::size_t most, FoundRow<T>& row) {
    const std::uint32_t itself = job.keep == KeepPoints::all ? 0 : job.itself[k];
    walk_region(
        job.tree, region,
        [&](const PointLeaf<T, Dim>& group, std::uint32_t in, const T* d2) HWY_ATTR {
            row.add(group, kept_of(group, in, job.keep, itself), d2);
            return row.size() <= most;
        },
        nullptr);
}

template <class Region, class T, int Dim>
void collect_within(const WithinJob<T, Dim>& job, PointJobCounts& counts, RowChunk<T>& rows) {
    FoundRow<T> row(job.budget);
    each_query<Region>(
        job, counts,
        [&](const Region& region, std::size_t k, std::size_t place) HWY_ATTR {
            if (rows.size > job.most_collected) return;
            row.clear();
            find_row(job, region, k, job.most_collected, row);
            if (row.size() > job.most_collected) {  // by itself too much to keep
                rows.size = row.size();
                return;
            }
            job.counts[place] = static_cast<std::uint32_t>(row.size());
            if (row.size() == 0) return;
            rows.reserve(row.size());
            row.write(job, rows.ids.data() + rows.size, rows.distances.data() + rows.size);
            rows.size += row.size();
            counts.found += row.size();
        },
        [&](std::size_t place) { job.counts[place] = 0; });
}

template <class Region, class T, int Dim>
void fill_within(const WithinJob<T, Dim>& job) {
    FoundRow<T> row(job.budget);
    PointJobCounts counts;
    each_query<Region>(
        job, counts,
        [&](const Region& region, std::size_t k, std::size_t place) HWY_ATTR {
            if (job.counts[place] == 0) return;
            row.clear_for(job.counts[place]);
            find_row(job, region, k, std::numeric_limits<std::size_t>::max(), row);
            const std::uint64_t begin = job.offset_of(place);
            row.write(job, job.indices + begin, job.distances + begin);
        },
        [](std::size_t) {});
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
