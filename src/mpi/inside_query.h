// Inside or outside by parity, as a kind for rounds.h: crossings of the half line along +x are
// counted on each rank that it meets, and a point on a triangle of any rank is inside.
#pragma once

#include <raydix/mpi.h>

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/distance.h"
#include "exec/parallel.h"
#include "mpi/rank_tree.h"
#include "mpi/rounds.h"
#include "proximity/crossings.h"
#include "trace/double_tree.h"
#include "trace/tree_hits.h"

namespace raydix::mpi {

template <class T>
struct CrossingTree;
template <>
struct CrossingTree<float> {
    using Bvh = raydix::Bvh;
    using View = TriangleTree;
    [[nodiscard]] static Vec3 prepared(Vec3 query) { return query; }
};
template <>
struct CrossingTree<double> {
    using Bvh = BvhD;
    using View = TriangleTreeD;
    /// As the exact signs want it.
    [[nodiscard]] static Vec3d prepared(Vec3d query) { return without_tiny(query); }
};

template <class T>
class InsideKind {
    using Point = BasicVec3<T>;
    using Bvh = typename CrossingTree<T>::Bvh;

public:
    using Scalar = T;
    using Question = Point;
    static constexpr bool asks_all = true;

    InsideKind(const Bvh& triangles, const RankTree<T>& tree, int threads,
               std::span<const Point> queries, Answers<std::uint8_t, QueryCounts>& answers)
        : triangles_(triangles),
          tree_(tree),
          threads_(threads),
          queries_(queries),
          answers_(answers) {}

    /// Bit 0: an odd number of crossings. Bit 1: on a triangle.
    void clear() { answers_.values.assign(queries_.size(), 0); }
    [[nodiscard]] std::size_t size() const { return queries_.size(); }
    [[nodiscard]] bool first(std::size_t, Candidate<T>&) const { return false; }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        found.clear();
        if (!is_finite(queries_[i])) return;
        const Point p = CrossingTree<T>::prepared(queries_[i]);
        tree_.all(
            0,
            [&p](const RankBox<T>& box) {
                // Trees of doubles take those below 2^-500 for 0.
                constexpr T tiny = sizeof(T) == 4 ? T(0) : T(0x1p-500);
                const bool met = box.hi[0] >= p.x - tiny && box.lo[1] <= p.y + tiny &&
                                 p.y <= box.hi[1] + tiny && box.lo[2] <= p.z + tiny &&
                                 p.z <= box.hi[2] + tiny;
                return met ? T(0) : std::numeric_limits<T>::quiet_NaN();
            },
            found);
    }
    [[nodiscard]] Question question(std::size_t i) const { return queries_[i]; }
    void answer(std::span<const Question> points) {
        bits_.assign(points.size(), 0);
        with_threads(threads_, [&] { add_crossings(triangles_, points, bits_); });
    }
    [[nodiscard]] static std::uint64_t most_answer_bytes() { return sizeof(std::uint8_t); }
    void put_answer(std::size_t q, Bytes& out) const { put(out, bits_[q]); }
    void take(std::size_t i, Reader& reader) {
        join(answers_.values[i], reader.take<std::uint8_t>());
    }
    void finish() {
        answers_.counts.queries = queries_.size();
        for (std::size_t i = 0; i < queries_.size(); ++i) {
            answers_.values[i] = answers_.values[i] != 0;
            answers_.counts.found += answers_.values[i];
            answers_.counts.invalid_queries += !is_finite(queries_[i]);
        }
    }

private:
    static void join(std::uint8_t& bits, unsigned more) {
        bits = static_cast<std::uint8_t>(((bits ^ more) & 1u) | ((bits | more) & 2u));
    }
    static void add_crossings(const Bvh& triangles, std::span<const Question> points,
                              std::vector<std::uint8_t>& bits) {
        const typename CrossingTree<T>::View tree(triangles);
        if (tree.empty) return;
        for_each_range(points.size(), 64, [&](std::size_t begin, std::size_t end) {
            BasicWalkStack<T> stack(tree.max_depth);
            for (std::size_t q = begin; q < end; ++q) {
                const Crossings c =
                    count_crossings(tree, CrossingTree<T>::prepared(points[q]), stack);
                join(bits[q], (c.count % 2 != 0 ? 1u : 0u) | (c.on_surface ? 2u : 0u));
            }
        });
    }

    const Bvh& triangles_;
    const RankTree<T>& tree_;
    int threads_;
    std::span<const Point> queries_;
    Answers<std::uint8_t, QueryCounts>& answers_;
    std::vector<std::uint8_t> bits_;  // of answers
};

}  // namespace raydix::mpi
