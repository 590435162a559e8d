#include "point_peer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <thread>

namespace raydix::bench {
namespace {

/// body(thread, begin, end) for chunks of [0, n).
template <class Body>
void in_chunks(std::size_t n, int threads, const Body& body) {
    constexpr std::size_t chunk = 1024;
    std::atomic<std::size_t> next{0};
    const auto work = [&](int thread) {
        for (std::size_t begin = next.fetch_add(chunk); begin < n; begin = next.fetch_add(chunk))
            body(thread, begin, std::min(begin + chunk, n));
    };
    std::vector<std::thread> others;
    for (int t = 1; t < threads; ++t) others.emplace_back(work, t);
    work(0);
    for (std::thread& thread : others) thread.join();
}

}  // namespace

struct PointPeer::Tree {
    struct Cloud {
        std::span<const Vec3> points;

        [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
        [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t d) const {
            return (&points[i].x)[d];
        }
        template <class Box>
        bool kdtree_get_bbox(Box&) const {
            return false;
        }
    };
    using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>,
                                                      Cloud, 3, std::uint32_t>;

    Cloud cloud;
    int max_leaf;
    Index index;

    Tree(std::span<const Vec3> points, int leaf)
        : cloud{points},
          max_leaf(leaf),
          index(3, cloud,
                nanoflann::KDTreeSingleIndexAdaptorParams(static_cast<std::size_t>(leaf))) {
        index.buildIndex();
    }
};

PointPeer::PointPeer(std::span<const Vec3> points, int max_leaf)
    : tree_(std::make_unique<Tree>(points, max_leaf)) {}
PointPeer::~PointPeer() = default;
PointPeer::PointPeer(PointPeer&&) noexcept = default;

std::string PointPeer::name() const { return "nanoflann leaf " + std::to_string(tree_->max_leaf); }

void PointPeer::knn(std::span<const Vec3> queries, std::uint32_t k, int threads,
                    PeerRows& rows) const {
    rows.indices.resize(queries.size() * k);
    rows.distances.resize(queries.size() * k);
    in_chunks(queries.size(), threads, [&](int, std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            nanoflann::KNNResultSet<float, std::uint32_t, std::uint32_t> result(k);
            result.init(&rows.indices[i * k], &rows.distances[i * k]);
            tree_->index.findNeighbors(result, &queries[i].x, nanoflann::SearchParams());
            for (std::size_t n = i * k; n < i * k + k; ++n)
                rows.distances[n] = std::sqrt(rows.distances[n]);
        }
    });
}

void PointPeer::radius(std::span<const Vec3> queries, float radius, int threads,
                       std::span<std::uint32_t> counts, std::vector<PeerRows>& rows) const {
    rows.resize(static_cast<std::size_t>(threads));
    for (PeerRows& of_thread : rows) {
        of_thread.indices.clear();
        of_thread.distances.clear();
    }
    // nanoflann asks for d2 < the bound.
    const float bound = std::nextafter(radius * radius, std::numeric_limits<float>::infinity());
    nanoflann::SearchParams unsorted;
    unsorted.sorted = false;
    in_chunks(queries.size(), threads, [&](int thread, std::size_t begin, std::size_t end) {
        PeerRows& mine = rows[static_cast<std::size_t>(thread)];
        std::vector<std::pair<std::uint32_t, float>> found;
        for (std::size_t i = begin; i < end; ++i) {
            tree_->index.radiusSearch(&queries[i].x, bound, found, unsorted);
            counts[i] = static_cast<std::uint32_t>(found.size());
            for (const auto& [index, d2] : found) {
                mine.indices.push_back(index);
                mine.distances.push_back(std::sqrt(d2));
            }
        }
    });
}

std::string nanoflann_version() {
    const int version = NANOFLANN_VERSION;
    return std::to_string(version >> 8) + "." + std::to_string(version >> 4 & 15) + "." +
           std::to_string(version & 15);
}

}  // namespace raydix::bench
