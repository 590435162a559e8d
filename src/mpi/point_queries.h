// Queries of points, as kinds for rounds.h.
#pragma once

#include <raydix/mpi.h>
#include <raydix/points.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "mpi/global_ids.h"
#include "mpi/rank_tree.h"
#include "mpi/result_rows.h"
#include "mpi/rounds.h"
#include "points/squared_queries.h"

namespace raydix::mpi {

/// What the queries of points read on a rank.
template <class T>
struct PointsView {
    const PointIndex<T, 3>& index;
    const GlobalIds& ids;
    const RankTree<T>& tree;
    int threads;
};

template <class Point>
[[nodiscard]] bool is_finite_point(const Point& p) {
    return (p.x * 0 + p.y * 0) + p.z * 0 == 0;  // 0 times NaN or Inf is NaN
}

/// The k nearest. Rows hold d2 until all is known.
template <class T>
class NearestKind {
public:
    using Scalar = T;
    using Point = typename PointIndex<T, 3>::Point;
    struct Question {
        Point at;
        T most_d2;
    };
    static constexpr bool asks_all = false;

    NearestKind(const PointsView<T>& view, std::span<const Point> queries, std::uint32_t k,
                NearestRows<T>& rows)
        : view_(view), queries_(queries), k_(k), rows_(rows), merged_(k) {}

    /// Rows without points.
    void clear() {
        rows_.indices.reset(queries_.size() * k_);
        rows_.distances.reset(queries_.size() * k_);
        std::fill_n(rows_.indices.data(), rows_.indices.size(), no_global);
        std::fill_n(rows_.distances.data(), rows_.distances.size(), T(infinity));
    }
    [[nodiscard]] std::size_t size() const { return queries_.size(); }
    [[nodiscard]] bool first(std::size_t i, Candidate<T>& found) const {
        return is_finite_point(queries_[i]) && view_.tree.first(most_d2(i), bound_of(i), found);
    }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        view_.tree.all(most_d2(i), bound_of(i), found);
    }
    [[nodiscard]] Question question(std::size_t i) const { return {queries_[i], most_d2(i)}; }

    void answer(std::span<const Question> questions) {
        const std::size_t n = questions.size();
        std::vector<Point> points(n);
        std::vector<T> most(n);
        ids_.resize(n * k_);
        d2_.resize(n * k_);
        for (std::size_t q = 0; q < n; ++q) {
            points[q] = questions[q].at;
            most[q] = questions[q].most_d2;
        }
        PointQueryOptions options;
        options.threads = view_.threads;
        squared_nearest(view_.index, std::span<const Point>(points), most.data(), k_,
                        std::span(ids_), std::span(d2_), options);
    }
    [[nodiscard]] std::uint64_t most_answer_bytes() const {
        return sizeof(std::uint32_t) + std::uint64_t{k_} * (sizeof(std::uint64_t) + sizeof(T));
    }
    void put_answer(std::size_t q, Bytes& out) const {
        const std::uint32_t* row = ids_.data() + q * k_;
        const auto found = static_cast<std::uint32_t>(std::find(row, row + k_, no_primitive) - row);
        put(out, found);
        std::size_t at = out.size();
        out.resize(at + found * (sizeof(std::uint64_t) + sizeof(T)));
        for (std::uint32_t j = 0; j < found; ++j) {
            const std::uint64_t id = view_.ids.of(row[j]);
            std::memcpy(out.data() + at, &id, sizeof(id));
            std::memcpy(out.data() + at + sizeof(id), &d2_[q * k_ + j], sizeof(T));
            at += sizeof(id) + sizeof(T);
        }
    }

    /// Both rows ascend by (d2, number); the first k of both stay.
    void take(std::size_t i, Reader& reader) {
        std::uint64_t* ids = rows_.indices.data() + i * k_;
        T* d2 = rows_.distances.data() + i * k_;
        const auto found = reader.take<std::uint32_t>();
        std::copy_n(ids, k_, merged_.ids.begin());
        std::copy_n(d2, k_, merged_.d2.begin());
        std::uint32_t old = 0, place = 0;
        for (std::uint32_t j = 0; j < found; ++j) {
            const auto id = reader.take<std::uint64_t>();
            const auto at = reader.take<T>();
            const auto comes_first = [&] {
                return merged_.d2[old] < at || (merged_.d2[old] == at && merged_.ids[old] < id);
            };
            for (; place < k_ && comes_first(); ++place, ++old) {
                ids[place] = merged_.ids[old];
                d2[place] = merged_.d2[old];
            }
            if (place == k_) continue;  // the rest of the answer is still read
            ids[place] = id;
            d2[place++] = at;
        }
        for (; place < k_; ++place, ++old) {
            ids[place] = merged_.ids[old];
            d2[place] = merged_.d2[old];
        }
    }

    /// Distances of squares, and what was found.
    void finish() {
        rows_.counts.queries = queries_.size();
        for (const Point& query : queries_) rows_.counts.invalid_queries += !is_finite_point(query);
        for (std::size_t j = 0; j < rows_.distances.size(); ++j) {
            rows_.distances[j] = std::sqrt(rows_.distances[j]);
            rows_.counts.found += rows_.indices[j] != no_global;
        }
    }

private:
    struct Row {
        explicit Row(std::size_t k) : ids(k), d2(k) {}
        std::vector<std::uint64_t> ids;
        std::vector<T> d2;
    };

    [[nodiscard]] T most_d2(std::size_t i) const { return rows_.distances[(i + 1) * k_ - 1]; }
    [[nodiscard]] auto bound_of(std::size_t i) const {
        return [query = &queries_[i].x](const RankBox<T>& box) { return least_d2(query, box); };
    }

    PointsView<T> view_;
    std::span<const Point> queries_;
    std::uint32_t k_;
    NearestRows<T>& rows_;
    Row merged_;
    std::vector<std::uint32_t> ids_;  // of answers, [questions * k]
    std::vector<T> d2_;
};

/// All within a radius or a box. Region says which.
template <class T, class Region>
class WithinKind {
public:
    using Scalar = T;
    using Question = typename Region::Query;
    static constexpr bool asks_all = true;

    WithinKind(const PointsView<T>& view, const Region& region, std::span<const Question> queries,
               RowStore<FoundGlobal<T>>& rows)
        : view_(view), region_(region), queries_(queries), rows_(rows) {}

    [[nodiscard]] std::size_t size() const { return queries_.size(); }
    [[nodiscard]] bool first(std::size_t, Candidate<T>&) const { return false; }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        found.clear();
        if (!Region::is_valid(queries_[i])) return;
        view_.tree.all(
            0,
            [&](const RankBox<T>& box) {
                return region_.meets(queries_[i], box) ? T(0) : std::numeric_limits<T>::quiet_NaN();
            },
            found);
    }
    [[nodiscard]] Question question(std::size_t i) const { return queries_[i]; }

    std::uint64_t answer_some(std::span<const Question> questions, std::uint64_t most, Bytes& out) {
        return answer_in_chunks(questions, most, out,
                                [&](std::span<const Question> chunk, std::uint64_t limit) {
                                    put_rows(region_.search(view_, chunk, limit), out);
                                });
    }
    void take(std::size_t i, Reader& reader) { rows_.take(i, reader); }

private:
    void put_rows(const PointLists<T>& lists, Bytes& out) const {
        for (std::size_t q = 0; q + 1 < lists.offsets.size(); ++q) {
            put(out, lists.offsets[q + 1] - lists.offsets[q]);
            for (std::uint64_t j = lists.offsets[q]; j < lists.offsets[q + 1]; ++j)
                put(out, FoundGlobal<T>{view_.ids.of(lists.indices[j]), lists.distances[j]});
        }
    }

    PointsView<T> view_;
    Region region_;
    std::span<const Question> queries_;
    RowStore<FoundGlobal<T>>& rows_;
};

template <class T>
struct BallRegion {
    using Query = typename PointIndex<T, 3>::Point;
    T radius;

    /// What must not be negative.
    [[nodiscard]] T least() const { return radius; }
    [[nodiscard]] static bool is_valid(const Query& query) { return is_finite_point(query); }
    [[nodiscard]] bool meets(const Query& query, const RankBox<T>& box) const {
        return least_d2(&query.x, box) <= radius * radius;
    }
    /// d2 in place of distances.
    [[nodiscard]] PointLists<T> search(const PointsView<T>& view, std::span<const Query> queries,
                                       std::uint64_t max_result_bytes) const {
        PointQueryOptions options;
        options.threads = view.threads;
        options.max_result_bytes = max_result_bytes;
        const std::vector<T> radii(queries.size(), radius);
        return squared_radius_search(view.index, queries, std::span<const T>(radii), options);
    }
};

template <class T>
struct BoxRegion {
    using Query = typename PointIndex<T, 3>::Box;

    [[nodiscard]] T least() const { return 0; }
    [[nodiscard]] static bool is_valid(const Query& query) {
        return is_finite_point(query.lo) && is_finite_point(query.hi);
    }
    [[nodiscard]] bool meets(const Query& query, const RankBox<T>& box) const {
        const T *lo = &query.lo.x, *hi = &query.hi.x;
        for (int d = 0; d < 3; ++d)
            if (!(lo[d] <= box.hi[d] && box.lo[d] <= hi[d])) return false;
        return true;
    }
    [[nodiscard]] PointLists<T> search(const PointsView<T>& view, std::span<const Query> queries,
                                       std::uint64_t max_result_bytes) const {
        PointQueryOptions options;
        options.threads = view.threads;
        options.max_result_bytes = max_result_bytes;
        return box_search(view.index, queries, options);
    }
};

}  // namespace raydix::mpi
