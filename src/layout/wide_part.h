// Parts of a WideBvh that are written each by itself, and the places where they come to lie.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "layout/block_filler.h"
#include "layout/wide_bvh.h"

namespace raydix {

/// What the figures of WideBvhStats are made of. Areas are half surfaces.
struct WideSums {
    double node_area = 0, child_area = 0, decoded_area = 0;
    double triangle_area = 0;  // of the leaves, times their triangles
    std::uint64_t children = 0, leaves = 0, references = 0;
    std::uint32_t levels = 0;

    void add(const WideSums& other);
};

/// In compact blocks, until vertices have their numbers: there is no triangle in this lane.
inline constexpr std::uint32_t no_vertex = ~std::uint32_t{0};

/// In the word of a child of the top that is the first node of another part: which one.
inline constexpr std::uint32_t wide_part_bit = 0x40000000u;

/// Children that are nodes, and places of leaves, are numbered within the part.
struct WidePart {
    std::vector<WideNode> nodes;
    std::vector<TriangleBlock> blocks;
    std::vector<CompactNode> compact_nodes;
    std::vector<CompactBlock> compact_blocks;  // vertices by the view's numbers
    BlockFiller filler;
    WideSums sums;

    void clear();
    [[nodiscard]] std::size_t node_count() const { return nodes.size() + compact_nodes.size(); }
};

/// Memory of parts that wait for their places, kept from one tree to the next.
using PartPool = std::vector<std::unique_ptr<WidePart>>;
/// An empty part.
[[nodiscard]] std::unique_ptr<WidePart> take_part(PartPool& pool);

/// What is known of parts before they are written.
struct PartRoom {
    std::size_t references, parts, blocks;
};
/// Blocks that so many references most often fit in.
[[nodiscard]] std::size_t guessed_blocks(std::size_t references);

/// The figures that need the bounds, and the bytes. `middle`: what planes of nodes are about.
void set_tree_figures(const WideSums& sums, const Aabb& bounds, Vec3 middle, WideBvh::Arrays& out);

/// Puts parts behind each other into the arrays of a tree, the top first. A part is copied as soon
/// as the sizes of all before it are known, while it is in a cache, and its memory serves the next:
/// what a build touches for the first time is little more than the tree. The arrays do not depend
/// on the order in which parts are finished.
class PartPlacer {
public:
    /// `references`: of the binary tree. The room for nodes and blocks is guessed from them; what
    /// does not fit waits, and is copied once more.
    PartPlacer(bool compact, std::size_t references, std::size_t parts, PartPool& pool,
               WideBvh::Arrays& out);
    /// For parts whose blocks are written where they stay, the top's apart, which has none: the
    /// array of blocks is as long as they need. Not compact.
    PartPlacer(const PartRoom& room, PartPool& pool, WideBvh::Arrays& out);

    /// The part that all others hang from; before all others.
    void set_top(std::unique_ptr<WidePart> top);
    /// An empty part to write to. Any thread.
    [[nodiscard]] std::unique_ptr<WidePart> take();
    /// Part k, from 0, is written. Any thread, each part once.
    void place(std::size_t k, std::unique_ptr<WidePart> part);
    /// When all parts are placed: where the nodes of part k begin.
    [[nodiscard]] std::size_t first_node(std::size_t k) const { return states_[k].bases.node; }
    /// When all parts are placed: the arrays are complete, and those figures that need no more than
    /// sums. Throws InputError for too many triangles.
    WideSums finish();

private:
    /// Where a part's arrays begin in those of the whole tree.
    struct Bases {
        std::size_t node = 0, block = 0;
    };
    struct State {
        std::unique_ptr<WidePart> waiting;
        std::size_t nodes = 0, blocks = 0;
        Bases bases;
        WideSums sums;
        bool written = false;
    };

    void make_room(Bases room);
    [[nodiscard]] bool fits(const State& state) const;
    void copy(const WidePart& part, const Bases& bases);
    void copy_top();
    void set_figures(const WideSums& sums);

    bool compact_;
    PartPool& pool_;
    WideBvh::Arrays& out_;
    std::unique_ptr<WidePart> top_;
    std::mutex mutex_;  // of all that follows, and of the pool
    std::vector<State> states_;
    std::size_t next_ = 0;  // the first part whose place is not known
    Bases end_;             // of the parts whose places are known
    Bases room_;
};

}  // namespace raydix
