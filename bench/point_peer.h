// nanoflann behind a plain interface: builds on one thread, batches in chunks over threads.
#pragma once

#include <raydix/points.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace raydix::bench {

/// What a batch found; for a radius in no order, and concatenated per thread.
struct PeerRows {
    std::vector<std::uint32_t> indices;
    std::vector<float> distances;
};

class PointPeer {
public:
    /// Builds at once.
    PointPeer(std::span<const Vec3> points, int max_leaf);
    ~PointPeer();
    PointPeer(PointPeer&&) noexcept;

    [[nodiscard]] std::string name() const;
    /// indices, distances [queries * k]
    void knn(std::span<const Vec3> queries, std::uint32_t k, int threads, PeerRows& rows) const;
    /// counts [queries]; d2 <= R*R as raydix has it. True distances.
    void radius(std::span<const Vec3> queries, float radius, int threads,
                std::span<std::uint32_t> counts, std::vector<PeerRows>& rows) const;

private:
    struct Tree;
    std::unique_ptr<Tree> tree_;
};

[[nodiscard]] std::string nanoflann_version();

}  // namespace raydix::bench
