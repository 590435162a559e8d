#include "tree/sah_top.h"

#include <algorithm>

#include "base/math.h"
#include "exec/parallel.h"
#include "tree/radix_tree.h"

namespace raydix {
namespace {

void sum_up(std::vector<SahTopNode>& top) {
    for (std::size_t i = top.size(); i-- > 0;) {
        SahTopNode& at = top[i];
        if (at.left == 0) continue;
        const SahTopNode &a = top[at.left], &b = top[at.left + 1];
        at.sum.inner = 1 + a.sum.inner + b.sum.inner;
        at.sum.references = a.sum.references + b.sum.references;
        at.sum.height = 1 + std::max(a.sum.height, b.sum.height);
        const Aabb box = unite({a.node.lo, a.node.hi}, {b.node.lo, b.node.hi});
        at.node = {box.lo, 0, box.hi, 0};
    }
}

/// What a task counted from 0 moves to its place.
void place_task(const SahTopNode& task, const SubtreeOut& out, Buffer<BvhNode>& nodes,
                Buffer<std::uint32_t>& order) {
    BvhNode* to = nodes.data() + pair_slot(task.rank);
    for (std::size_t k = 0; k < 2 * std::size_t{task.sum.inner}; ++k) {
        to[k] = out.nodes[k];
        to[k].first += to[k].is_leaf() ? task.first : pair_slot(task.rank);
    }
    std::copy(out.order, out.order + task.sum.references, order.data() + task.first);
}

}  // namespace

void place_subtrees(std::vector<SahTopNode>& top, SubtreeStore& store, Buffer<BvhNode>& nodes,
                    Buffer<std::uint32_t>& order) {
    sum_up(top);
    nodes.reset(2 * std::size_t{top[0].sum.inner} + 2);
    order.reset(top[0].sum.references);
    nodes[1] = {{0, 0, 0}, 0, {0, 0, 0}, 0};
    std::vector<std::uint32_t> tasks;
    for (std::uint32_t i = 0; i < top.size(); ++i) {
        SahTopNode& at = top[i];
        if (at.left == 0) {
            tasks.push_back(i);
            at.node.first += at.node.is_leaf() ? at.first : pair_slot(at.rank);
            continue;
        }
        at.node.first = pair_slot(at.rank);
        SahTopNode &a = top[at.left], &b = top[at.left + 1];
        a.rank = at.rank + 1;
        a.first = at.first;
        b.rank = a.rank + a.sum.inner;
        b.first = a.first + a.sum.references;
    }
    nodes[0] = top[0].node;
    for (const SahTopNode& at : top) {
        if (at.left == 0) continue;
        nodes[pair_slot(at.rank)] = top[at.left].node;
        nodes[pair_slot(at.rank) + 1] = top[at.left + 1].node;
    }
    for_each_index(
        tasks.size(),
        [&](std::size_t t) {
            const SahTopNode& task = top[tasks[t]];
            place_task(task, store.of(task), nodes, order);
        },
        1);
}

}  // namespace raydix
