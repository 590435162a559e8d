#include "tree/counted_builds.h"

#include <raydix/error.h>

#include <string>

#include "base/probe.h"
#include "tree/apetrei.h"
#include "tree/fit_levels.h"
#include "tree/garanzha.h"
#include "tree/hierarchy.h"
#include "tree/karras_launches.h"
#include "tree/lauterbach.h"

namespace raydix {
namespace {

template <class Probe>
struct LeafBoxOfBoxes {
    const Aabb* boxes;
    Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = boxes[first];
        for (std::uint32_t k = first + 1; k < first + count; ++k) box = unite(box, boxes[k]);
        Probe::bytes(std::uint64_t{count} * sizeof(Aabb));
        Probe::step();
        return box;
    }
};

template <class Key, class Probe>
class CountedRun {
    using LeafBox = LeafBoxOfBoxes<Probe>;

public:
    CountedRun(std::span<const Key> keys, std::span<const Aabb> boxes, int max_leaf)
        : in_{keys.data(), static_cast<std::uint32_t>(keys.size()),
              static_cast<std::uint32_t>(max_leaf)},
          limit_(inner_node_limit(in_.count, in_.max_leaf)),
          leaf_box_{boxes.data()},
          launcher_(&result_.launches) {
        nodes_.reset(2 * std::size_t{limit_} + 2);
        scratch_.parent_slot.reset(limit_);
        out_ = {nodes_.data(), scratch_.parent_slot.data(), &result_.inner_count};
    }

    CountedBuild run(Builder builder, Fit fit) {
        const BuildOptions options{.builder = builder, .fit = fit};
        const bool by_levels = fits_by_levels(options);
        const bool fused = builder == Builder::apetrei && !by_levels;
        hierarchy(builder, fused);
        if (fused) return take();
        if (limit_ == 0) {
            launcher_.launch("fit.only_leaf", 1,
                             FitOnlyLeaf<LeafBox>{leaf_box_, nodes_.data(), &result_.max_depth});
        } else if (by_levels) {
            fit_by_levels();
        } else {
            launch_fit_atomic(launcher_, leaf_box_, nodes_.data(), out_.parent_slot,
                              out_.inner_count, limit_, memory_for<std::uint8_t>(limit_),
                              &result_.max_depth);
        }
        return take();
    }

private:
    template <class Scratch, class... Sizes>
    Scratch make_scratch(Sizes... sizes) {
        scratch_.memory.reset(scratch_bytes<Scratch>(sizes...));
        Arena arena(scratch_.memory.data(), scratch_.memory.size());
        return Scratch{arena, sizes...};
    }
    template <class T>
    T* memory_for(std::size_t count) {
        scratch_.memory.reset(count * sizeof(T));
        return reinterpret_cast<T*>(scratch_.memory.data());
    }
    [[nodiscard]] std::uint32_t level_limit() const {
        return lbvh_depth_bound(CodeFormat<Key>::bits, in_.count);
    }

    void hierarchy(Builder builder, bool fused) {
        const std::uint32_t n = in_.count;
        switch (builder) {
            case Builder::karras:
                return launch_karras(launcher_, in_, make_scratch<KarrasScratch>(n), out_);
            case Builder::lauterbach: {
                scratch_.levels = make_levels(level_limit(), scratch_);
                const std::uint32_t width =
                    lauterbach_band_width(n, level_limit(), lauterbach_memory_limit(n));
                return launch_lauterbach(launcher_, in_,
                                         make_scratch<LauterbachScratch>(n, level_limit(), width),
                                         out_, scratch_.levels);
            }
            case Builder::garanzha:
                scratch_.levels = make_levels(level_limit(), scratch_);
                return launch_garanzha(
                    launcher_, in_, make_scratch<GaranzhaScratch>(n, in_.max_leaf, level_limit()),
                    out_, scratch_.levels);
            case Builder::apetrei: {
                const auto scratch = make_scratch<ApetreiScratch>(n, in_.max_leaf);
                std::uint32_t* depth = &result_.max_depth;
                return fused ? launch_apetrei(launcher_, in_, scratch, leaf_box_, out_, depth)
                             : launch_apetrei(launcher_, in_, scratch, NoLeafBox{}, out_, depth);
            }
            default:
                break;
        }
        throw InputError("builder " + std::string(builder_name(builder)) +
                         " is not counted; karras, lauterbach, garanzha and apetrei are");
    }

    void fit_by_levels() {
        Buffer<std::uint32_t> ranks;
        if (scratch_.levels.limit == 0) {
            ranks.reset(limit_);
            scratch_.levels = launch_find_levels(launcher_, nodes_.data(), limit_, ranks.data(),
                                                 make_levels(level_limit(), scratch_));
        }
        launch_fit_levels(launcher_, leaf_box_, nodes_.data(), out_.parent_slot, limit_,
                          scratch_.levels, make_scratch<FitLevelsScratch>(limit_),
                          &result_.max_depth);
    }

    CountedBuild take() {
        result_.bounds = box_of(nodes_[0]);
        return std::move(result_);
    }

    CountedBuild result_;
    LbvhInput<Key> in_;
    std::uint32_t limit_;
    LeafBox leaf_box_;
    HostLauncher<Probe> launcher_;
    Buffer<BvhNode> nodes_;
    HierarchyScratch scratch_;
    TreeLinks out_{};
};

}  // namespace

template <class Key>
CountedBuild count_build(Builder builder, Fit fit, std::span<const Key> keys,
                         std::span<const Aabb> leaf_boxes, int max_leaf) {
    return CountedRun<Key, CountProbe>(keys, leaf_boxes, max_leaf).run(builder, fit);
}

template <class Key>
CountedBuild time_build(Builder builder, Fit fit, std::span<const Key> keys,
                        std::span<const Aabb> leaf_boxes, int max_leaf) {
    return CountedRun<Key, NoProbe>(keys, leaf_boxes, max_leaf).run(builder, fit);
}

template CountedBuild count_build(Builder, Fit, std::span<const std::uint32_t>,
                                  std::span<const Aabb>, int);
template CountedBuild count_build(Builder, Fit, std::span<const std::uint64_t>,
                                  std::span<const Aabb>, int);

template CountedBuild time_build(Builder, Fit, std::span<const std::uint32_t>,
                                 std::span<const Aabb>, int);
template CountedBuild time_build(Builder, Fit, std::span<const std::uint64_t>,
                                 std::span<const Aabb>, int);

}  // namespace raydix
