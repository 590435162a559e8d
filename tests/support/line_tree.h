// Brute force for large scenes: which triangles may a line meet? A median-split tree of eight
// children a node with bounds in double and wide margins, walked along the whole line: no entry
// distance, no limit and no earlier hit ever skips a node, so a fault of the library's culling
// cannot hide here. Every candidate goes through the library's triangle test.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix::test {

class LineTree {
public:
    explicit LineTree(const MeshView& mesh);
    /// The least (t, prim) over all triangles that the closed test accepts.
    [[nodiscard]] Hit closest(const Ray& ray) const;
    /// All that the half-open test accepts, sorted by (t, prim).
    [[nodiscard]] std::vector<Hit> all(const Ray& ray) const;
    /// `closest` for each ray, over all threads.
    [[nodiscard]] std::vector<Hit> closest(std::span<const Ray> rays) const;

private:
    static constexpr int width = 8;
    /// The boxes of up to eight children, by axis and child.
    struct Node {
        double middle[3][width], half[3][width];  // of a child that is not there: -infinity
        std::uint32_t child[width];               // a node, or is_triangle and a place in ids_
    };
    void split(std::uint32_t self, std::span<std::uint32_t> ids, std::span<const Vec3> centers);
    template <class Visit>
    void visit_candidates(const Ray& ray, const Visit& visit) const;

    MeshView mesh_;
    std::vector<std::uint32_t> ids_;
    std::vector<LeafTriangle> corners_;  // of ids_
    std::vector<Node> nodes_;
};

}  // namespace raydix::test
