#include "tree/sweep_split.h"

#include <algorithm>
#include <vector>

#include "base/prefetch.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

/// References of a list that one thread takes at a time.
constexpr std::uint32_t block_references = 4096;
/// References are read in the order of one axis, so from all over memory.
constexpr std::uint32_t ahead = 16;

constexpr std::uint32_t unevenness(std::uint32_t left, std::uint32_t n) {
    return left < n - left ? n - 2 * left : 2 * left - n;
}

/// Sweeps the cuts behind places [begin, end) of one list. `before` and `behind` hold what the list
/// has before begin and from end on.
class BlockSweep {
public:
    BlockSweep(const SweepLists& lists, std::uint32_t axis, float* areas)
        : lists_(lists), order_(lists.orders[axis]), axis_(axis), areas_(areas) {}

    SweepSplit run(std::uint32_t begin, std::uint32_t end, GrowingBox before, GrowingBox behind) {
        const std::uint32_t n = lists_.n;
        for (std::uint32_t k = end; k-- > begin;) {
            if (k >= begin + ahead) prefetch(k - ahead);
            areas_[k - begin] = behind.area();
            behind.add(at(k));
        }
        SweepSplit best;
        best.axis = axis_;
        const std::uint32_t last = std::min(end, n - 1);
        for (std::uint32_t k = begin; k < last; ++k) {
            before.add(at(k));
            const std::uint32_t left = k + 1;
            const float cost = before.area() * static_cast<float>(left) +
                               areas_[k - begin] * static_cast<float>(n - left);
            if (cost > best.cost) continue;
            if (cost < best.cost || unevenness(left, n) < unevenness(best.left, n)) {
                best.cost = cost;
                best.left = left;
            }
        }
        return best;
    }

private:
    [[nodiscard]] const SahReference& at(std::uint32_t k) const {
        return lists_.references[order_[k]];
    }
    RAYDIX_PREFETCHING void prefetch(std::uint32_t k) const { __builtin_prefetch(&at(k)); }

    const SweepLists& lists_;
    const std::uint32_t* order_;
    std::uint32_t axis_;
    float* areas_;
};

}  // namespace

bool is_better(const SweepSplit& a, const SweepSplit& b, std::uint32_t n) {
    if (a.left == 0 || b.left == 0) return b.left == 0 && a.left != 0;
    if (a.cost != b.cost) return a.cost < b.cost;
    const std::uint32_t uneven_a = unevenness(a.left, n), uneven_b = unevenness(b.left, n);
    if (uneven_a != uneven_b) return uneven_a < uneven_b;
    return a.axis != b.axis ? a.axis < b.axis : a.left < b.left;
}

SweepSplit find_sweep_split(const SweepLists& lists, float* areas) {
    SweepSplit best;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const SweepSplit split = BlockSweep(lists, axis, areas).run(0, lists.n, {}, {});
        if (is_better(split, best, lists.n)) best = split;
    }
    return best;
}

SweepSplit find_sweep_split_parallel(const SweepLists& lists) {
    const std::uint32_t n = lists.n;
    const std::uint32_t blocks = (n + block_references - 1) / block_references;
    const auto first_of = [](std::uint32_t b) { return b * block_references; };
    const auto end_of = [n](std::uint32_t b) { return std::min(n, (b + 1) * block_references); };
    std::vector<GrowingBox> own(3 * blocks), behind(3 * blocks);
    for_each_index(
        own.size(),
        [&](std::size_t i) {
            const auto axis = i / blocks;
            const auto b = static_cast<std::uint32_t>(i % blocks);
            const std::uint32_t* order = lists.orders[axis];
            for (std::uint32_t k = first_of(b), end = end_of(b); k < end; ++k) {
                if (k + ahead < end) __builtin_prefetch(&lists.references[order[k + ahead]]);
                own[i].add(lists.references[order[k]]);
            }
        },
        1);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        GrowingBox box;
        for (std::size_t b = blocks; b-- > 0;) {
            behind[axis * blocks + b] = box;
            box.add(own[axis * blocks + b]);
        }
        box = {};
        for (std::size_t b = 0; b < blocks; ++b) {
            GrowingBox& at = own[axis * blocks + b];
            std::swap(at, box);  // what lies before the block
            box.add(at);
        }
    }
    std::vector<SweepSplit> found(own.size());
    for_each_range(own.size(), 1, [&](std::size_t begin, std::size_t end) {
        std::array<float, block_references> areas;
        for (std::size_t i = begin; i < end; ++i) {
            const auto axis = static_cast<std::uint32_t>(i / blocks);
            const auto b = static_cast<std::uint32_t>(i % blocks);
            found[i] = BlockSweep(lists, axis, areas.data())
                           .run(first_of(b), end_of(b), own[i], behind[i]);
        }
    });
    SweepSplit best;
    for (const SweepSplit& split : found)
        if (is_better(split, best, n)) best = split;
    return best;
}

}  // namespace raydix
