// Edges are sorted by a hash of their ends; those of one hash are then compared in full.
#include "proximity/edge_closure.h"

#include <raydix/error.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "proximity/closest_on_triangle.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

/// From its first end to its last in the order of comes_first.
template <class Vec>
struct Edge {
    Vec from, to;
    bool turned;  // the triangle runs through it the other way

    [[nodiscard]] bool empty() const { return from == to; }
};

template <class Corners, class Vec = decltype(Corners::v0)>
Edge<Vec> edge_of(std::span<const Corners> triangles, std::uint32_t id) {
    const Corners& t = triangles[id / 3];
    const std::uint32_t k = id % 3;
    const Vec a = k == 0 ? t.v0 : k == 1 ? t.v1 : t.v2, b = k == 0 ? t.v1 : k == 1 ? t.v2 : t.v0;
    return comes_first(b, a) ? Edge<Vec>{b, a, true} : Edge<Vec>{a, b, false};
}

template <class Vec>
bool same_ends(const Edge<Vec>& a, const Edge<Vec>& b) {
    return a.from == b.from && a.to == b.to;
}
template <class Vec>
bool before(const Edge<Vec>& a, const Edge<Vec>& b) {
    return a.from == b.from ? comes_first(a.to, b.to) : comes_first(a.from, b.from);
}

/// Multiplies and folds each word in; any spread will do, equal edges are found by comparison.
template <class Vec>
std::uint64_t hash_of(const Edge<Vec>& edge) {
    using Word = std::conditional_t<sizeof(edge.from.x) == 4, std::uint32_t, std::uint64_t>;
    std::uint64_t hash = 0x243f6a8885a308d3ull;
    for (const auto x : {edge.from.x, edge.from.y, edge.from.z, edge.to.x, edge.to.y, edge.to.z}) {
        hash = (hash ^ std::bit_cast<Word>(x)) * 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 29;
    }
    return hash;
}

/// One run of equal edges.
template <class Corners>
void count_run(std::span<const Corners> triangles, std::span<const std::uint32_t> run,
               EdgeClosure& closure) {
    if (edge_of(triangles, run[0]).empty()) return;
    std::int64_t balance = 0;
    for (const std::uint32_t id : run) balance += edge_of(triangles, id).turned ? -1 : 1;
    closure.odd += run.size() % 2;
    closure.unbalanced += balance != 0;
}

/// Edges of one hash.
template <class Corners>
void count_group(std::span<const Corners> triangles, std::span<std::uint32_t> group,
                 EdgeClosure& closure) {
    const auto edge = [&](std::uint32_t id) { return edge_of(triangles, id); };
    std::sort(group.begin(), group.end(), [&](std::uint32_t a, std::uint32_t b) {
        const auto ea = edge(a), eb = edge(b);
        return same_ends(ea, eb) ? a < b : before(ea, eb);
    });
    for (std::size_t begin = 0; begin < group.size();) {
        std::size_t end = begin + 1;
        while (end < group.size() && same_ends(edge(group[begin]), edge(group[end]))) ++end;
        count_run<Corners>(triangles, group.subspan(begin, end - begin), closure);
        begin = end;
    }
}

template <class Corners>
EdgeClosure match_all(std::span<const Corners> triangles) {
    if (triangles.size() > 0xFFFFFFFFull / 3)
        throw InputError(std::to_string(triangles.size()) +
                         " triangles; edges can be matched for up to 1431655765");
    const std::size_t n = 3 * triangles.size();
    std::vector<std::uint64_t> keys(n);
    std::vector<std::uint32_t> order(n);
    for_each_index(n, [&](std::size_t i) {
        keys[i] = hash_of(edge_of(triangles, static_cast<std::uint32_t>(i)));
    });
    SortScratch<std::uint64_t> scratch;
    sort_keys<std::uint64_t>(keys, order, 64, scratch);
    std::atomic<std::uint64_t> odd{0}, unbalanced{0};
    for_each_range(n, 4096, [&](std::size_t begin, std::size_t end) {
        EdgeClosure part;
        for (std::size_t i = begin; i < end; ++i) {
            if (i != 0 && keys[i] == keys[i - 1]) continue;  // whose group begins before
            std::size_t last = i + 1;
            while (last < n && keys[last] == keys[i]) ++last;
            count_group(triangles, std::span(order).subspan(i, last - i), part);
        }
        odd += part.odd;
        unbalanced += part.unbalanced;
    });
    return {odd, unbalanced};
}

}  // namespace

EdgeClosure match_edges(std::span<const LeafTriangle> triangles) { return match_all(triangles); }
EdgeClosure match_edges(std::span<const LeafTriangleD> triangles) { return match_all(triangles); }

}  // namespace raydix
