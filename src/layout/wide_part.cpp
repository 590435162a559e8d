#include "layout/wide_part.h"

#include <raydix/error.h>

#include <algorithm>
#include <string>
#include <utility>

#include "exec/large_pages.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::uint32_t lanes = BlockFiller::lanes;
/// Beyond, a leaf's word would be a NaN as a float: kernels take that for a missing child.
constexpr std::size_t max_places = (1u << 28) - (1u << 20);

/// Nodes and blocks for each reference of the binary tree, as 8-wide trees of scans, of buildings
/// and of plants have them (0.08 to 0.1 and 0.21 to 0.265), and a little more.
constexpr double nodes_a_reference = 0.1, blocks_a_reference = 0.27;

template <class Node>
void copy_nodes(const std::vector<Node>& nodes, std::size_t node_base, std::size_t block_base,
                Node* out) {
    const auto add_node = static_cast<std::uint32_t>(node_base);
    const auto add_leaf = static_cast<std::uint32_t>(block_base * lanes << 3);
    for (const Node& node : nodes) {
        *out = node;
        for (std::uint32_t& word : out->child) {
            const std::uint32_t add = (word & wide_leaf_bit) != 0 ? add_leaf : add_node;
            word += word == wide_no_child ? 0 : add;
        }
        ++out;
    }
}

std::size_t guessed_nodes(std::size_t references) {
    return static_cast<std::size_t>(nodes_a_reference * static_cast<double>(references));
}

template <class T>
std::size_t room_for(const Buffer<T>& buffer) {
    return buffer.capacity_bytes() / sizeof(T);
}

/// More room, with what is there.
template <class T>
void grow(Buffer<T>& buffer, std::size_t used, std::size_t size) {
    Buffer<T> larger(size);
    std::copy_n(buffer.data(), used, larger.data());
    buffer = std::move(larger);
}

}  // namespace

void WideSums::add(const WideSums& other) {
    node_area += other.node_area;
    child_area += other.child_area;
    decoded_area += other.decoded_area;
    triangle_area += other.triangle_area;
    children += other.children;
    leaves += other.leaves;
    references += other.references;
    levels = std::max(levels, other.levels);
}

std::size_t guessed_blocks(std::size_t references) {
    return static_cast<std::size_t>(blocks_a_reference * static_cast<double>(references));
}

void set_tree_figures(const WideSums& sums, const Aabb& bounds, Vec3 middle, WideBvh::Arrays& out) {
    WideBvhStats& stats = out.stats;
    stats.node_bytes =
        out.nodes.size() * sizeof(WideNode) + out.compact_nodes.size() * sizeof(CompactNode);
    stats.triangle_bytes = out.blocks.size() * sizeof(TriangleBlock) +
                           out.compact_blocks.size() * sizeof(CompactBlock) +
                           out.vertices.size() * sizeof(Vec3);
    stats.bytes = stats.node_bytes + stats.triangle_bytes;
    out.set_bounds(bounds, middle);
    const double root = half_area(out.bounds);
    stats.sah = root > 0 ? (sums.node_area + wide_primitive_cost * sums.triangle_area) / root : 0;
}

void WidePart::clear() {
    nodes.clear();
    blocks.clear();
    compact_nodes.clear();
    compact_blocks.clear();
    filler = {};
    sums = {};
}

std::unique_ptr<WidePart> take_part(PartPool& pool) {
    if (pool.empty()) return std::make_unique<WidePart>();
    std::unique_ptr<WidePart> part = std::move(pool.back());
    pool.pop_back();
    part->clear();
    return part;
}

PartPlacer::PartPlacer(bool compact, std::size_t references, std::size_t parts, PartPool& pool,
                       WideBvh::Arrays& out)
    : compact_(compact), pool_(pool), out_(out), states_(parts) {
    // One part alone: its size is known before anything is copied.
    if (parts > 1) make_room({guessed_nodes(references), guessed_blocks(references) + 4 * parts});
}

PartPlacer::PartPlacer(const PartRoom& room, PartPool& pool, WideBvh::Arrays& out)
    : compact_(false), pool_(pool), out_(out), states_(room.parts) {
    make_room({room.parts > 1 ? guessed_nodes(room.references) : 0, room.blocks});
}

void PartPlacer::make_room(Bases room) {
    out_.nodes.reset(compact_ ? 0 : room.node);
    out_.blocks.reset(compact_ ? 0 : room.block);
    out_.compact_nodes.reset(compact_ ? room.node : 0);
    out_.compact_blocks.reset(compact_ ? room.block : 0);
    prefer_large_pages(out_.nodes);
    prefer_large_pages(out_.blocks);
    prefer_large_pages(out_.compact_nodes);
    prefer_large_pages(out_.compact_blocks);
    // A tree that is built again may have more.
    room_ = compact_ ? Bases{room_for(out_.compact_nodes), room_for(out_.compact_blocks)}
                     : Bases{room_for(out_.nodes), room_for(out_.blocks)};
}

void PartPlacer::set_top(std::unique_ptr<WidePart> top) {
    top_ = std::move(top);
    end_ = {top_->node_count(), top_->filler.blocks()};
}

std::unique_ptr<WidePart> PartPlacer::take() {
    const std::lock_guard lock(mutex_);
    return take_part(pool_);
}

bool PartPlacer::fits(const State& state) const {
    return state.bases.node + state.nodes <= room_.node &&
           state.bases.block + state.blocks <= room_.block;
}

void PartPlacer::place(std::size_t k, std::unique_ptr<WidePart> part) {
    std::vector<std::pair<std::unique_ptr<WidePart>, Bases>> ready;
    {
        const std::lock_guard lock(mutex_);
        State& own = states_[k];
        own.nodes = part->node_count();
        own.blocks = part->filler.blocks();
        own.sums = part->sums;
        own.waiting = std::move(part);
        own.written = true;
        for (; next_ < states_.size() && states_[next_].written; ++next_) {
            State& state = states_[next_];
            state.bases = end_;
            end_.node += state.nodes;
            end_.block += state.blocks;
            if (fits(state)) ready.emplace_back(std::move(state.waiting), state.bases);
        }
    }
    for (const auto& [written, bases] : ready) copy(*written, bases);
    const std::lock_guard lock(mutex_);
    for (auto& [written, bases] : ready) pool_.push_back(std::move(written));
}

void PartPlacer::copy(const WidePart& part, const Bases& bases) {
    if (compact_) {
        copy_nodes(part.compact_nodes, bases.node, bases.block,
                   out_.compact_nodes.data() + bases.node);
        std::ranges::copy(part.compact_blocks, out_.compact_blocks.data() + bases.block);
    } else {
        copy_nodes(part.nodes, bases.node, bases.block, out_.nodes.data() + bases.node);
        std::ranges::copy(part.blocks, out_.blocks.data() + bases.block);
    }
}

void PartPlacer::copy_top() {
    const auto name_parts = [&](auto& nodes) {
        for (auto& node : nodes)
            for (std::uint32_t& word : node.child)
                if ((word & wide_leaf_bit) == 0 && (word & wide_part_bit) != 0)
                    word = static_cast<std::uint32_t>(states_[word & ~wide_part_bit].bases.node);
    };
    name_parts(top_->nodes);
    name_parts(top_->compact_nodes);
    copy(*top_, {});
    pool_.push_back(std::move(top_));
}

WideSums PartPlacer::finish() {
    if (end_.block > max_places / lanes)
        throw InputError("a wide tree holds " + std::to_string(max_places) +
                         " triangle references at most");
    if (end_.node > room_.node || end_.block > room_.block) {
        Bases used;
        for (const State& state : states_) {
            if (state.waiting) break;
            used = {state.bases.node + state.nodes, state.bases.block + state.blocks};
        }
        const auto grow_both = [&](auto& nodes, auto& blocks) {
            if (end_.node > room_.node) grow(nodes, used.node, end_.node);
            if (end_.block > room_.block) grow(blocks, used.block, end_.block);
        };
        if (compact_)
            grow_both(out_.compact_nodes, out_.compact_blocks);
        else
            grow_both(out_.nodes, out_.blocks);
        for_each_index(
            states_.size(),
            [&](std::size_t k) {
                if (states_[k].waiting) copy(*states_[k].waiting, states_[k].bases);
            },
            1);
        for (State& state : states_)
            if (state.waiting) pool_.push_back(std::move(state.waiting));
    }
    make_room(end_);
    WideSums sums = top_->sums;
    for (const State& state : states_) sums.add(state.sums);
    copy_top();
    set_figures(sums);
    return sums;
}

void PartPlacer::set_figures(const WideSums& sums) {
    WideBvhStats& stats = out_.stats;
    stats.nodes = end_.node;
    stats.leaves = sums.leaves;
    stats.references = sums.references;
    stats.max_depth = sums.levels;
    stats.children_per_node = static_cast<double>(sums.children) / static_cast<double>(stats.nodes);
    const bool quantised = compact_ && sums.child_area > 0;
    stats.widening = quantised ? sums.decoded_area / sums.child_area : 1.0;
}

}  // namespace raydix
