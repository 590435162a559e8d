// The k nearest points of a query. Included once per instruction set.
#if defined(RAYDIX_POINTS_NEAREST_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_POINTS_NEAREST_H
#undef RAYDIX_POINTS_NEAREST_H
#else
#define RAYDIX_POINTS_NEAREST_H
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "base/heap_row.h"
#include "points/lanes.h"
#include "points/point_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Up to `capacity` of the nearest so far, in float32: keys of (d2, id) in ascending order in
/// vector registers.
template <int capacity>
class KeyRow {
    using D = hn::CappedTag<std::int64_t, 8>;
    using V = hn::Vec<D>;
    static constexpr int lanes = static_cast<int>(hn::MaxLanes(D()));
    static constexpr int vectors = capacity / lanes;

public:
    /// Points farther than `most_d2` are never in the row.
    KeyRow(std::uint32_t k, std::uint32_t*, float*, float most_d2) : k_(k) {
        constexpr D d;
        const std::uint64_t missing = nearness_key(most_d2, no_primitive);
        for (V& v : keys_) v = hn::Set(d, static_cast<std::int64_t>(missing));
        first_ = hn::FirstN(d, 1);
        alignas(64) std::int64_t from[lanes];
        for (int i = 0; i < lanes; ++i) from[i] = (i + lanes - 1) % lanes;
        rotate_ = hn::IndicesFromVec(d, hn::Load(d, from));
        worst_ = missing;
    }

    [[nodiscard]] HWY_INLINE float worst_d2() const {
        return std::bit_cast<float>(static_cast<std::uint32_t>(worst_ >> 32));
    }
    [[nodiscard]] HWY_INLINE std::uint32_t worst_id() const {
        return static_cast<std::uint32_t>(worst_);
    }

    /// One comparison a key: each becomes the least of itself and of the greater of the new one and
    /// its left neighbour.
    HWY_INLINE void offer(float d2, std::uint32_t id) {
        constexpr D d;
        const V added = hn::Set(d, static_cast<std::int64_t>(nearness_key(d2, id)));
        V rotated = hn::TableLookupLanes(keys_[vectors - 1], rotate_);
        for (int i = vectors - 1; i > 0; --i) {
            const V before = hn::TableLookupLanes(keys_[i - 1], rotate_);
            const V left = hn::IfThenElse(first_, before, rotated);
            keys_[i] = hn::Min(keys_[i], hn::Max(left, added));
            rotated = before;
        }
        const V left = hn::IfThenElse(first_, hn::Zero(d), rotated);
        keys_[0] = hn::Min(keys_[0], hn::Max(left, added));
    }
    /// Before `worst` is asked again.
    HWY_INLINE void settle() {
        alignas(64) std::uint64_t keys[capacity];
        store(keys);
        worst_ = keys[k_ - 1];
    }

    template <bool squared>
    HWY_INLINE std::uint32_t finish(std::uint32_t* indices, float* distances) const {
        alignas(64) std::uint64_t keys[capacity];
        store(keys);
        std::uint32_t found = 0;
        for (std::uint32_t i = 0; i < k_; ++i) {
            indices[i] = static_cast<std::uint32_t>(keys[i]);
            const float d2 = std::bit_cast<float>(static_cast<std::uint32_t>(keys[i] >> 32));
            const bool is_found = indices[i] != no_primitive;
            distances[i] = !is_found ? infinity : squared ? d2 : std::sqrt(d2);
            found += is_found;
        }
        return found;
    }

private:
    HWY_INLINE void store(std::uint64_t* keys) const {
        constexpr hn::RebindToUnsigned<D> u;
        for (int i = 0; i < vectors; ++i) hn::Store(hn::BitCast(u, keys_[i]), u, keys + i * lanes);
    }

    V keys_[vectors];
    hn::Mask<D> first_;
    decltype(hn::IndicesFromVec(D(), hn::Zero(D()))) rotate_;
    std::uint64_t worst_;
    std::uint32_t k_;
};

/// The same for any scalar: a sorted row in the caller's memory, for k that is not large.
template <class T>
class SortedRow {
public:
    SortedRow(std::uint32_t k, std::uint32_t* indices, T* distances, T most_d2)
        : ids_(indices), d2_(distances), k_(k) {
        for (std::uint32_t i = 0; i < k; ++i) {
            ids_[i] = no_primitive;
            d2_[i] = most_d2;
        }
    }
    [[nodiscard]] T worst_d2() const { return d2_[k_ - 1]; }
    [[nodiscard]] std::uint32_t worst_id() const { return ids_[k_ - 1]; }
    HWY_INLINE void offer(T d2, std::uint32_t id) {
        if (!comes_before(d2, id, k_ - 1)) return;
        std::uint32_t hole = k_ - 1;
        for (; hole > 0 && comes_before(d2, id, hole - 1); --hole) {
            d2_[hole] = d2_[hole - 1];
            ids_[hole] = ids_[hole - 1];
        }
        d2_[hole] = d2;
        ids_[hole] = id;
    }
    void settle() const {}
    template <bool squared>
    std::uint32_t finish(std::uint32_t*, T*) const {
        std::uint32_t found = 0;
        for (std::uint32_t i = 0; i < k_; ++i) {
            const bool is_found = ids_[i] != no_primitive;
            d2_[i] = !is_found ? T(infinity) : squared ? d2_[i] : std::sqrt(d2_[i]);
            found += is_found;
        }
        return found;
    }

private:
    [[nodiscard]] HWY_INLINE bool comes_before(T d2, std::uint32_t id, std::uint32_t at) const {
        return d2 < d2_[at] || (d2 == d2_[at] && id < ids_[at]);
    }
    std::uint32_t* ids_;
    T* d2_;
    std::uint32_t k_;
};

/// The same for any k.
template <class T>
class LongRow : public HeapRow<T> {
public:
    LongRow(std::uint32_t k, std::uint32_t* indices, T* distances, T most_d2)
        : HeapRow<T>(k, indices, distances), most_d2_(most_d2) {}
    [[nodiscard]] T worst_d2() const { return std::min(most_d2_, HeapRow<T>::worst_d2()); }

private:
    T most_d2_;
};

/// One level of a walk: the node, how near its children are, and which are still to be entered.
template <class T, int Dim>
struct NearestFrame {
    alignas(64) T d2[boxes_per_node];
    const PointNode<T, Dim>* node;
    std::uint32_t waiting;
};

/// Depth first, the nearest child first; the tree's exact depth bounds the frames.
template <class T, int Dim, class Row>
class NearestWalk {
    using Frame = NearestFrame<T, Dim>;

public:
    HWY_INLINE NearestWalk(const PointTreeView<T, Dim>& tree, const T* query, Row& row)
        : tree_(tree), query_(query), row_(row) {}

    HWY_INLINE void run() {
        Frame* frame = frames_;
        enter(*frame, tree_.nodes[0]);
        for (;;) {
            if (frame->waiting == 0) {
                if (frame == frames_) return;
                drop_far(*--frame);
                continue;
            }
            const std::uint32_t child = nearest_of(*frame);
            frame->waiting &= ~(1u << child);
            const std::uint32_t below = frame->node->below + child;
            if (frame->node->is_bottom == 0) {
                enter(*++frame, tree_.nodes[below]);
            } else {
                scan(tree_.leaves[below]);
                drop_far(*frame);
            }
        }
    }

private:
    /// The nearest that waits. Keys are d2 with its lowest bits replaced by the number of the
    /// child: which of two almost equal ones comes first does not matter.
    [[nodiscard]] static HWY_INLINE std::uint32_t nearest_of(const Frame& frame) {
        if ((frame.waiting & (frame.waiting - 1)) == 0)
            return static_cast<std::uint32_t>(std::countr_zero(frame.waiting));
        using Key = hwy::MakeUnsigned<T>;
        constexpr hn::RebindToUnsigned<Lanes<T>> u;
        const auto none = hn::Set(u, hwy::LimitsMax<Key>());
        auto least = none;
        for (std::uint32_t part = 0; part < parts_of<T>; ++part) {
            const std::uint32_t from = part * lanes_of<T>;
            const auto d2 = hn::BitCast(u, hn::Load(Lanes<T>(), frame.d2 + from));
            const auto key =
                hn::Or(hn::AndNot(hn::Set(u, Key{15}), d2), hn::Iota(u, static_cast<Key>(from)));
            const auto waits = mask_of(u, frame.waiting >> from);
            least = hn::Min(least, hn::IfThenElse(waits, key, none));
        }
        return static_cast<std::uint32_t>(hn::GetLane(hn::MinOfLanes(u, least)) & 15);
    }

    HWY_INLINE void enter(Frame& frame, const PointNode<T, Dim>& node) {
        frame.node = &node;
        const auto worst = hn::Set(Lanes<T>(), row_.worst_d2());
        std::uint32_t equal = 0;
        const std::uint32_t near = each_part<T>([&](std::uint32_t from) HWY_ATTR {
            const auto d2 = least_squared_distances(node, query_, from);
            hn::Store(d2, Lanes<T>(), frame.d2 + from);
            equal |= bits_of(Lanes<T>(), hn::Eq(d2, worst)) << from;
            return bits_of(Lanes<T>(), hn::Le(d2, worst));
        });
        frame.waiting = near & node.child_mask();
        if (HWY_UNLIKELY((equal & frame.waiting) != 0)) drop_later(frame, equal & frame.waiting);
    }

    HWY_INLINE void drop_far(Frame& frame) {
        if (frame.waiting == 0) return;
        const auto worst = hn::Set(Lanes<T>(), row_.worst_d2());
        std::uint32_t equal = 0;
        frame.waiting &= each_part<T>([&](std::uint32_t from) HWY_ATTR {
            const auto d2 = hn::Load(Lanes<T>(), frame.d2 + from);
            equal |= bits_of(Lanes<T>(), hn::Eq(d2, worst)) << from;
            return bits_of(Lanes<T>(), hn::Le(d2, worst));
        });
        if (HWY_UNLIKELY((equal & frame.waiting) != 0)) drop_later(frame, equal & frame.waiting);
    }

    /// Children that are just as far as the last of the row matter only if they hold a lower id:
    /// without this, each of many equal points would be looked at.
    HWY_NOINLINE void drop_later(Frame& frame, std::uint32_t equal) {
        for (; equal != 0; equal &= equal - 1) {
            const auto c = static_cast<std::uint32_t>(std::countr_zero(equal));
            if (frame.node->lowest_id[c] > row_.worst_id()) frame.waiting &= ~(1u << c);
        }
    }

    HWY_INLINE void scan(const PointLeaf<T, Dim>& leaf) {
        alignas(64) T d2[points_per_leaf];
        const auto worst = hn::Set(Lanes<T>(), row_.worst_d2());
        std::uint32_t near = each_part<T>([&](std::uint32_t from) {
            const auto of_part = squared_distances(leaf, query_, from);
            hn::Store(of_part, Lanes<T>(), d2 + from);
            return bits_of(Lanes<T>(), hn::Le(of_part, worst));
        });
        for (; near != 0; near &= near - 1) {
            const auto i = static_cast<std::uint32_t>(std::countr_zero(near));
            row_.offer(d2[i], leaf.id[i]);
        }
        row_.settle();
    }

    const PointTreeView<T, Dim>& tree_;
    QueryLanes<T, Dim> query_;
    Row& row_;
    Frame frames_[max_point_depth];
};

template <class T, int Dim>
HWY_INLINE bool is_finite(const T* query) {
    T sum = 0;  // 0 * inf and 0 * NaN are NaN
    for (int d = 0; d < Dim; ++d) sum += query[d] * T{0};
    return sum == 0;
}

template <class Row, class T, int Dim>
void nearest_rows(const NearestJob<T, Dim>& job, PointJobCounts& counts) {
    for (std::size_t i = 0; i < job.n; ++i) {
        const std::size_t place = job.place(i);
        const T* query = job.queries + place * Dim;
        std::uint32_t* indices = job.indices + place * job.k;
        T* distances = job.distances + place * job.k;
        Row row(job.k, indices, distances,
                job.most_d2 == nullptr ? job.limit_d2 : job.most_d2[place]);
        const bool valid = is_finite<T, Dim>(query);
        counts.invalid += !valid;
        if (valid && !job.tree.empty()) NearestWalk<T, Dim, Row>(job.tree, query, row).run();
        counts.found += job.squared ? row.template finish<true>(indices, distances)
                                    : row.template finish<false>(indices, distances);
    }
}

template <class T, int Dim>
void nearest(const NearestJob<T, Dim>& job, PointJobCounts& counts) {
    if (job.k > 32) return nearest_rows<LongRow<T>>(job, counts);
    if constexpr (std::is_same_v<T, float>) {
        if (job.k <= 8) return nearest_rows<KeyRow<8>>(job, counts);
        if (job.k <= 16) return nearest_rows<KeyRow<16>>(job, counts);
        return nearest_rows<KeyRow<32>>(job, counts);
    } else {
        return nearest_rows<SortedRow<T>>(job, counts);
    }
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
