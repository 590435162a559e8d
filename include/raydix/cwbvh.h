// The compressed wide BVH (Ylitie, Karras, Laine 2017, sections 3.1 and 3.2): nodes of 80 bytes
// with up to eight children, made from any binary tree of triangles. raydix/device_cwbvh.h traces
// it on a GPU.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <memory>

namespace raydix {

/// Figures of a compressed wide tree.
struct CwbvhStats {
    std::uint64_t nodes = 0;           // of 80 bytes
    std::uint64_t inner_children = 0;  // children that are nodes: nodes - 1
    std::uint64_t leaf_children = 0;   // children of 1 to 3 triangles
    std::uint64_t references = 0;      // triangles in leaves
    std::uint64_t triangles = 0;  // different ones; less than references if a builder splits them
    std::uint32_t max_depth = 0;  // edges from the root to the deepest leaf child
    double children_per_node = 0;
    double sah = 0;       // 1 a node and 1 a triangle, by the boxes before they are quantised; 0
                          // if the root has no area
    double widening = 1;  // surface of all quantised child boxes / that of the exact ones; 1
                          // without surface
    std::uint64_t node_bytes = 0, triangle_bytes = 0;
    std::uint64_t bytes = 0;        // every byte a trace touches
    double bytes_per_triangle = 0;  // bytes / triangles
    std::uint64_t peak_bytes = 0;   // most bytes that making it took at once, this tree included,
                                    // above those that were held before
};

/// Holds all that a trace reads: the binary tree may go. Children are chosen by dynamic programming
/// over the surface area heuristic. Child boxes have 8 bits an axis and are rounded outward. The
/// tree has the same bits for every number of threads. A tree that was moved from is empty.
class Cwbvh {
public:
    /// `threads`: 0 to 1,024; 0: all the machine has. Throws InputError: a tree that holds boxes or
    /// points, threads out of range.
    explicit Cwbvh(const Bvh& bvh, int threads = 0);
    ~Cwbvh();
    Cwbvh(Cwbvh&&) noexcept;
    Cwbvh& operator=(Cwbvh&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] const CwbvhStats& stats() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const {
        const Arrays* const own = arrays_.get();
        return own != nullptr ? *own : nothing();
    }

private:
    [[nodiscard]] static const Arrays& nothing();
    std::unique_ptr<Arrays> arrays_;
};

}  // namespace raydix
