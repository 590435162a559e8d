#include "engine/support.h"

#include <array>
#include <utility>
#include <vector>

#include "engine/scene_tree.h"
#include "engine/shape_tree.h"

namespace raydix {
namespace {

/// Goes down a wide tree to the farthest corners of its triangles.
template <bool compact>
class Farthest {
public:
    explicit Farthest(const MeshTree& mesh)
        : view_(mesh.view), spare_(0x1p-40 * 3.0 * largest_coordinate(mesh.tree->arrays().bounds)) {
        view_.room = &room_;
    }

    /// The same for any tree around the same triangles: parts of it are left out only if they are
    /// nearer by more than what is rounded.
    double along(Double3 d) {
        double best = -std::numeric_limits<double>::infinity();
        waiting_.assign(1, {-best, 0});
        while (!waiting_.empty()) {
            const auto [reach, word] = waiting_.back();
            waiting_.pop_back();
            if (reach + spare_ < best) continue;
            if ((word & wide_leaf_bit) != 0)
                best = std::max(best, of_leaf(word, d));
            else
                open(view_.template node<compact>(word), d);
        }
        return best;
    }

private:
    static double reach_of(double lo, double hi, double d) { return d * (d < 0 ? lo : hi); }

    [[nodiscard]] double of_child(const WideNode& node, int s, Double3 d) const {
        return reach_of(double{node.lo[0][s]} + view_.middle[0],
                        double{node.hi[0][s]} + view_.middle[0], d.x) +
               reach_of(double{node.lo[1][s]} + view_.middle[1],
                        double{node.hi[1][s]} + view_.middle[1], d.y) +
               reach_of(double{node.lo[2][s]} + view_.middle[2],
                        double{node.hi[2][s]} + view_.middle[2], d.z);
    }
    [[nodiscard]] double of_child(const CompactNode& node, int s, Double3 d) const {
        const auto of_axis = [&](int a, double along) {
            const double step = std::ldexp(1.0, int{node.exponent[a]} - 127);
            return reach_of(node.origin[a] + step * node.lo[a][s],
                            node.origin[a] + step * node.hi[a][s], along);
        };
        return of_axis(0, d.x) + of_axis(1, d.y) + of_axis(2, d.z);
    }

    /// The farthest child is the next one.
    template <class Node>
    void open(const Node& node, Double3 d) {
        std::size_t at = waiting_.size();
        const std::size_t begin = at;
        for (int s = 0; s < static_cast<int>(quantised_width); ++s) {
            if (node.child[s] == wide_no_child) continue;
            waiting_.push_back({of_child(node, s, d), node.child[s]});
            for (at = waiting_.size() - 1; at > begin && waiting_[at - 1] > waiting_[at]; --at)
                std::swap(waiting_[at - 1], waiting_[at]);
        }
    }

    double of_leaf(std::uint32_t word, Double3 d) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        const TriangleBlock& block = view_.template block<compact>(place);
        double best = -std::numeric_limits<double>::infinity();
        for (std::uint32_t lane = place % block_lanes; lane < place % block_lanes + count; ++lane)
            for (int v = 0; v < 9; v += 3)
                best = std::max(best, dot(d, {block.corner[v][lane], block.corner[v + 1][lane],
                                              block.corner[v + 2][lane]}));
        return best;
    }

    WideView view_;
    TriangleBlock room_{};
    double spare_;
    std::vector<std::pair<double, std::uint32_t>> waiting_;  // reach, word
};

template <bool compact>
void add_mesh(const MeshTree& mesh, Support& support) {
    Farthest<compact> farthest(mesh);
    const double pad = mesh_pad(mesh.tree->arrays().bounds);
    support.widen([&](Double3 d) {
        const double grown = pad * (std::fabs(d.x) + std::fabs(d.y) + std::fabs(d.z));
        return Reach{farthest.along(d) + grown, farthest.along(d * -1.0) + grown};
    });
}

void add_box(const Aabb& box, Support& support) {
    const Double3 lo(box.lo), hi(box.hi), middle = (lo + hi) * 0.5, half = (hi - lo) * 0.5;
    support.widen([&](Double3 d) {
        const double at = dot(d, middle);
        const double by =
            std::fabs(d.x) * half.x + std::fabs(d.y) * half.y + std::fabs(d.z) * half.z;
        return Reach{at + by, by - at};
    });
}

}  // namespace

Support support_of(const SceneTree& scene) {
    Support out;
    if (!scene.instances.empty()) {
        add_box(scene.extent.box, out);
        return out;
    }
    for (const auto& mesh : scene.meshes) {
        if (mesh->tree->empty()) continue;
        mesh->view.is_compact ? add_mesh<true>(*mesh, out) : add_mesh<false>(*mesh, out);
    }
    for (const auto& shapes : scene.shapes)
        if (!shapes->empty()) add_box(shapes->extent.box, out);
    return out;
}

}  // namespace raydix
