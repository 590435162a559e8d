#include "tree/sbvh_build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "exec/parallel.h"
#include "exec/progress.h"
#include "tree/sah_reference.h"

namespace raydix {
namespace {

/// Subtrees of up to this many references are built by one thread each. Above the largest leaf, so
/// that no node above them becomes one.
constexpr std::uint32_t task_references = 8192;
static_assert(task_references > 255);

/// Levels below the top, for what is told of progress.
constexpr double task_levels = 13;

/// A subtree that one thread builds.
class SbvhSubtree {
public:
    SbvhSubtree(SbvhDivider divider, std::uint32_t max_leaf, int width)
        : divider_(std::move(divider)), max_leaf_(max_leaf), width_(width) {}

    SubtreeSum run(const SbvhList& list, const SubtreeOut& out, BvhNode& root) {
        out_ = out;
        pairs_ = listed_ = 0;
        const Below below = build(list, root);
        return {pairs_, listed_, below.height, below.cost};
    }

private:
    struct Below {
        float cost;
        std::uint32_t height;
    };

    Below build(const SbvhList& list, BvhNode& node) {
        if (list.count <= small_boxes && (list.count == 1 || divider_.is_object_only(list))) {
            for (std::uint32_t k = 0; k < list.count; ++k) {
                small_.set(k, list.at[k]);
                ids_[k] = list.at[k].first;
            }
            return build_small((1u << list.count) - 1, node);
        }
        const SbvhChildren lists = divider_.divide(list);
        return join(list.count, node, [&](BvhNode* children) {
            return std::array{build(lists.left, children[0]), build(lists.right, children[1])};
        });
    }

    Below build_small(LaneSet set, BvhNode& node) {
        const int count = std::popcount(set);
        if (count == 1) return leaf(static_cast<std::size_t>(std::countr_zero(set)), node);
        const LaneSet lowest = set & (0u - set);
        LaneSet left = count == 2 ? lowest : split_small(small_, set, width_);
        if ((left & lowest) == 0) left = set & ~left;
        return join(static_cast<std::uint32_t>(count), node, [&](BvhNode* children) {
            return std::array{build_small(left, children[0]),
                              build_small(set & ~left, children[1])};
        });
    }

    Below leaf(std::size_t lane, BvhNode& node) {
        const auto& at = small_.at;
        const Aabb box{{at[0][lane], at[1][lane], at[2][lane]},
                       {-at[3][lane], -at[4][lane], -at[5][lane]}};
        node = {box.lo, listed_, box.hi, 1};
        out_.order[listed_++] = ids_[lane];
        return {sah_area(box), 0};
    }

    /// A node over `count` references, or a leaf if that costs no more.
    template <class BuildChildren>
    Below join(std::uint32_t count, BvhNode& node, const BuildChildren& build_children) {
        const std::uint32_t pair = pairs_++, first = listed_;
        BvhNode* children = out_.nodes + 2 * std::size_t{pair};
        const auto [a, b] = build_children(children);
        const Aabb box = unite({children[0].lo, children[0].hi}, {children[1].lo, children[1].hi});
        const float area = sah_area(box);
        node = {box.lo, 2 * pair, box.hi, 0};
        const Below below{area + (a.cost + b.cost), 1 + std::max(a.height, b.height)};
        const float as_leaf = static_cast<float>(count) * area;
        if (count > max_leaf_ || !(as_leaf <= below.cost)) return below;
        // The list named each id once; below it, parts of a triangle may have become more.
        std::uint32_t *begin = out_.order + first, *end = out_.order + listed_;
        std::sort(begin, end);
        end = std::unique(begin, end);
        pairs_ = pair;
        listed_ = first + static_cast<std::uint32_t>(end - begin);
        node.first = first;
        node.count = count;
        return {as_leaf, 0};
    }

    SbvhDivider divider_;
    std::uint32_t max_leaf_;
    int width_;
    SubtreeOut out_{};
    std::uint32_t pairs_ = 0, listed_ = 0;
    SmallBoxes small_{};
    std::array<std::uint32_t, small_boxes> ids_{};
};

class SbvhRun {
public:
    SbvhRun(const SbvhInput& input, SbvhScratch& scratch, int width)
        : in_(input),
          s_(scratch),
          width_(width),
          divider_(input.cutter, input.options, root_area(), width) {}

    std::uint32_t run(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                      std::uint32_t& max_depth) {
        const std::size_t room = s_.references.size();
        s_.spare.reset(room);
        top_.push_back({});
        lists_.push_back({s_.references.data(), s_.spare.data(), in_.references,
                          static_cast<std::uint32_t>(room - in_.references), 0});
        const double top_levels =
            std::max(std::log2(double(in_.references) / task_references), 0.0);
        const ProgressCounter progress(in_.references * (top_levels + task_levels));
        split_top(progress);
        s_.subtrees.reset(room);
        build_tasks(progress);
        place_subtrees(top_, s_.subtrees, nodes, order);
        max_depth = top_[0].sum.height;
        return top_[0].sum.inner;
    }

private:
    [[nodiscard]] float root_area() const {
        Aabb box = empty_box();
        for (std::uint32_t k = 0; k < in_.references; ++k) box = unite(box, s_.references[k].box());
        return sah_area(box);
    }

    /// Level by level; all nodes of a level at once.
    void split_top(const ProgressCounter& progress) {
        for (std::size_t first = 0; first < top_.size();) {
            const std::size_t last = top_.size();
            std::vector<std::optional<SbvhChildren>> found(last - first);
            for_each_range(found.size(), 1, [&](std::size_t begin, std::size_t end) {
                SbvhDivider divider = divider_;
                for (std::size_t i = begin; i < end; ++i)
                    if (const std::uint32_t count = lists_[first + i].count;
                        count > task_references) {
                        found[i] = divider.divide(lists_[first + i]);
                        progress.add(count);
                    }
            });
            for (const auto& children : found) {
                if (children) {
                    top_[first].left = static_cast<std::uint32_t>(top_.size());
                    for (const SbvhList& list : {children->left, children->right}) {
                        SahTopNode node;
                        node.begin = top_[first].begin +
                                     static_cast<std::uint32_t>(list.at - lists_[first].other);
                        top_.push_back(node);
                        lists_.push_back(list);
                    }
                }
                ++first;
            }
        }
    }

    void build_tasks(const ProgressCounter& progress) {
        std::vector<std::uint32_t> tasks;
        for (std::uint32_t i = 0; i < top_.size(); ++i)
            if (top_[i].left == 0) tasks.push_back(i);
        for_each_range(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
            SbvhSubtree build(divider_, in_.max_leaf, width_);
            for (std::size_t t = begin; t < end; ++t) {
                SahTopNode& task = top_[tasks[t]];
                task.sum = build.run(lists_[tasks[t]], s_.subtrees.of(task), task.node);
                progress.add(task_levels * lists_[tasks[t]].count);
            }
        });
    }

    const SbvhInput& in_;
    SbvhScratch& s_;
    int width_;
    SbvhDivider divider_;
    std::vector<SahTopNode> top_;
    std::vector<SbvhList> lists_;  // of top_
};

}  // namespace

std::uint32_t spatial_spare(std::uint32_t n, const SpatialOptions& options) {
    const double wanted = options.budget * n;
    return static_cast<std::uint32_t>(std::min(wanted, double(0x7fffffffu - n)));
}

std::uint32_t build_sbvh(const SbvhInput& input, SbvhScratch& scratch, Buffer<BvhNode>& nodes,
                         Buffer<std::uint32_t>& order, std::uint32_t& max_depth, int width) {
    return SbvhRun(input, scratch, width).run(nodes, order, max_depth);
}

}  // namespace raydix
