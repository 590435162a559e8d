// Points with normals, for example reconstruct: planes through the nearest neighbours, turned
// alike, and the distance from them.
#pragma once

#include <raydix/points.h>

#include <algorithm>
#include <queue>
#include <vector>

#include "vec.h"

namespace example {

inline constexpr std::uint32_t near_count = 16;   // neighbours of a point, for its plane
inline constexpr std::uint32_t blend_count = 24;  // of a place, for its distance

/// The eigenvector of the least eigenvalue of a symmetric matrix: cyclic Jacobi turns.
inline Vec3 least_axis(double (&m)[3][3]) {
    double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int turn = 0; turn < 24; ++turn) {
        const int p = turn % 3 == 2 ? 1 : 0, q = turn % 3 == 0 ? 1 : 2;
        if (m[p][q] == 0) continue;
        const double half = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = std::copysign(1.0, half) / (std::abs(half) + std::sqrt(half * half + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (auto& row : m) {
            const double a = row[p], b = row[q];
            row[p] = c * a - s * b, row[q] = s * a + c * b;
        }
        for (int k = 0; k < 3; ++k) {
            const double a = m[p][k], b = m[q][k];
            m[p][k] = c * a - s * b, m[q][k] = s * a + c * b;
            const double x = axes[k][p], y = axes[k][q];
            axes[k][p] = c * x - s * y, axes[k][q] = s * x + c * y;
        }
    }
    const int least = m[0][0] < m[1][1] ? (m[0][0] < m[2][2] ? 0 : 2) : (m[1][1] < m[2][2] ? 1 : 2);
    return unit(Vec3{static_cast<float>(axes[0][least]), static_cast<float>(axes[1][least]),
                     static_cast<float>(axes[2][least])});
}

/// Points with normals that look outward.
class Cloud {
public:
    /// Throws raydix::InputError for fewer points than a distance takes.
    explicit Cloud(std::vector<Vec3> given)
        : points(enough(std::move(given))),
          index_(raydix::build_points(points)),
          near_(raydix::knn(index_, points, near_count)) {
        normals.reserve(points.size());
        for (std::size_t i = 0; i < points.size(); ++i) normals.push_back(plane_at(i));
        turn_alike();
    }

    /// Mean distance to the fourth neighbour.
    [[nodiscard]] float spacing() const {
        double sum = 0;
        for (std::size_t i = 0; i < points.size(); ++i) sum += near_.distances[i * near_count + 4];
        return static_cast<float>(sum / static_cast<double>(points.size()));
    }

    /// Mean of the distances from the planes of the nearest points, the nearer the more: negative
    /// inside. The weights fall to 0 at the last of them, so that it is continuous.
    [[nodiscard]] std::vector<float> distances_at(std::span<const Vec3> places) const {
        constexpr std::uint32_t k = blend_count;
        const auto near = raydix::knn(index_, places, k);
        std::vector<float> out(places.size());
        for (std::size_t i = 0; i < places.size(); ++i) {
            const float reach = near.distances[i * k + k - 1];
            float sum = 0, weights = 0;
            for (std::size_t j = i * k; j < (i + 1) * k; ++j) {
                const std::uint32_t p = near.indices[j];
                const float part = near.distances[j] / reach, rest = 1 - part * part;
                const float weight = rest * rest * rest * rest + 1e-12f;
                sum += weight * dot(places[i] - points[p], normals[p]);
                weights += weight;
            }
            out[i] = sum / weights;
        }
        return out;
    }

    std::vector<Vec3> points, normals;

private:
    static std::vector<Vec3> enough(std::vector<Vec3> given) {
        if (given.size() < blend_count)
            throw raydix::InputError("a surface takes " + std::to_string(blend_count) +
                                     " points or more, given " + std::to_string(given.size()));
        return given;
    }

    [[nodiscard]] Vec3 plane_at(std::size_t i) const {
        const std::uint32_t* row = &near_.indices[i * near_count];
        Vec3 mean{0, 0, 0};
        for (std::uint32_t k = 0; k < near_count; ++k)
            mean += 1.0f / near_count * (points[row[k]] - points[i]);
        double m[3][3] = {};
        for (std::uint32_t k = 0; k < near_count; ++k) {
            const Vec3 d = points[row[k]] - points[i] - mean;
            const double v[3] = {d.x, d.y, d.z};
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) m[a][b] += v[a] * v[b];
        }
        return least_axis(m);
    }

    /// From the highest point of each part on, whose normal looks up, over the edge between the two
    /// most parallel normals first (Prim's spanning tree).
    void turn_alike() {
        std::vector<std::uint32_t> by_height(points.size());
        for (std::uint32_t i = 0; i < by_height.size(); ++i) by_height[i] = i;
        std::ranges::sort(by_height, [&](std::uint32_t a, std::uint32_t b) {
            return points[a].y != points[b].y ? points[a].y > points[b].y : a < b;
        });
        struct Edge {
            float bend;
            std::uint32_t from, to;
            bool operator<(const Edge& other) const { return bend > other.bend; }
        };
        std::vector<char> done(points.size(), 0);
        std::priority_queue<Edge> edges;
        const auto reach = [&](std::uint32_t i) {
            done[i] = 1;
            for (std::uint32_t k = 0; k < near_count; ++k) {
                const std::uint32_t j = near_.indices[i * near_count + k];
                if (done[j] == 0) edges.push({1 - std::abs(dot(normals[i], normals[j])), i, j});
            }
        };
        for (const std::uint32_t start : by_height) {
            if (done[start] != 0) continue;
            if (normals[start].y < 0) normals[start] = -1.0f * normals[start];
            for (reach(start); !edges.empty();) {
                const Edge edge = edges.top();
                edges.pop();
                if (done[edge.to] != 0) continue;
                if (dot(normals[edge.from], normals[edge.to]) < 0)
                    normals[edge.to] = -1.0f * normals[edge.to];
                reach(edge.to);
            }
        }
    }

    raydix::Points index_;
    raydix::NearestPoints<float> near_;
};

}  // namespace example
