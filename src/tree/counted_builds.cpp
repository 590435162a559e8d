#include "tree/counted_builds.h"

#include <raydix/error.h>

#include <string>

#include "base/probe.h"
#include "tree/apetrei.h"
#include "tree/fit_levels.h"
#include "tree/garanzha.h"
#include "tree/garanzha_published.h"
#include "tree/hierarchy.h"
#include "tree/karras.h"
#include "tree/karras_launches.h"
#include "tree/karras_published.h"
#include "tree/lauterbach.h"
#include "tree/word_hash.h"

namespace raydix {
namespace {

/// Boxes and leaves in preorder. Keys of a leaf follow each other, so first and count say which.
/// `inner_per_level`, out: inner nodes by depth.
std::string digest_of(std::span<const BvhNode> nodes, std::vector<std::uint64_t>& inner_per_level) {
    WordHash hash;
    struct Place {
        std::uint32_t slot;
        std::size_t depth;
    };
    std::vector<Place> waiting{{0, 0}};
    while (!waiting.empty()) {
        const auto [slot, depth] = waiting.back();
        const BvhNode& node = nodes[slot];
        waiting.pop_back();
        hash.put(node.lo);
        hash.put(node.hi);
        hash.put(node.count);
        if (node.is_leaf()) {
            hash.put(node.first);
        } else {
            if (depth == inner_per_level.size()) inner_per_level.push_back(0);
            ++inner_per_level[depth];
            waiting.push_back({node.first + 1, depth + 1});
            waiting.push_back({node.first, depth + 1});
        }
    }
    return hash.hex();
}

template <class Key, class Probe>
class CountedRun {
    using LeafBox = LeafBoxOfBoxes<Probe>;

public:
    CountedRun(std::span<const Key> keys, std::span<const Aabb> boxes, int max_leaf,
               CountedMemory& memory)
        : keys_(keys),
          boxes_(boxes),
          max_leaf_(max_leaf),
          in_{keys.data(), static_cast<std::uint32_t>(keys.size()),
              static_cast<std::uint32_t>(max_leaf)},
          limit_(inner_node_limit(in_.count, in_.max_leaf)),
          leaf_box_{boxes.data()},
          launcher_(&result_.launches),
          memory_(memory),
          scratch_(memory.scratch) {
        memory_.nodes.reset(2 * std::size_t{limit_} + 2);
        scratch_.parent_slot.reset(limit_);
        scratch_.levels = {};
        out_ = {memory_.nodes.data(), scratch_.parent_slot.data(), &result_.inner_count};
    }

    CountedBuild run(const BuildWay& way) {
        const bool by_levels = fits_by_levels({.builder = way.builder, .fit = way.fit});
        const bool few = limit_ == 0 && way.form != StudyForm::launches;
        if (way.form == StudyForm::launches || few)
            build_by_launches(way.builder, by_levels);
        else if (way.form == StudyForm::published)
            build_as_published(way.builder, by_levels);
        else
            build_tuned(way.builder);
        result_.bounds = box_of(memory_.nodes[0]);
        if constexpr (Probe::counts)
            result_.digest = digest_of(memory_.nodes.view(), result_.inner_per_level);
        return std::move(result_);
    }

private:
    template <class Scratch, class... Sizes>
    Scratch make_scratch(Sizes... sizes) {
        scratch_.memory.reset(scratch_bytes<Scratch>(sizes...));
        Arena arena(scratch_.memory.data(), scratch_.memory.size());
        return Scratch{arena, sizes...};
    }
    [[nodiscard]] std::uint32_t level_limit() const {
        return lbvh_depth_bound(CodeFormat<Key>::bits, in_.count);
    }

    void build_by_launches(Builder builder, bool by_levels) {
        const bool fused = builder == Builder::apetrei && !by_levels;
        hierarchy(builder, fused);
        if (!fused) fit(by_levels);
    }
    void fit(bool by_levels) {
        if (limit_ == 0) {
            launcher_.launch("fit.only_leaf", 1,
                             FitOnlyLeaf<LeafBox>{leaf_box_, out_.nodes, &result_.max_depth});
        } else if (by_levels) {
            fit_by_levels();
        } else {
            scratch_.memory.reset(limit_);
            launch_fit_atomic(launcher_, leaf_box_, out_.nodes, out_.parent_slot, out_.inner_count,
                              limit_, reinterpret_cast<std::uint8_t*>(scratch_.memory.data()),
                              &result_.max_depth);
        }
    }

    void build_as_published(Builder builder, bool by_levels) {
        if (builder == Builder::garanzha) {
            scratch_.levels = make_levels(level_limit(), scratch_);
            launch_garanzha_published(launcher_, in_,
                                      make_scratch<GaranzhaQueueScratch>(in_.count, in_.max_leaf),
                                      out_, scratch_.levels);
            return fit(by_levels);
        }
        if (builder != Builder::karras || max_leaf_ != 1)
            throw InputError("builder " + std::string(builder_name(builder)) +
                             ", leaves of up to " + std::to_string(max_leaf_) +
                             ": its source has no such kernels");
        const auto scratch = make_scratch<PublishedScratch>(in_.count);
        launch_karras_published(launcher_, in_, scratch, out_);
        launch_fit_published(launcher_, leaf_box_, in_.count, scratch, out_, &result_.max_depth);
    }

    /// More than max_leaf keys.
    void build_tuned(Builder builder) {
        if (builder == Builder::karras) {
            launcher_.run_whole("karras.bytes", in_.count, [&] {
                result_.inner_count = build_karras(keys_, max_leaf_, memory_.nodes, scratch_);
            });
            return fit(false);
        }
        if (builder != Builder::apetrei)
            throw InputError("builder " + std::string(builder_name(builder)) +
                             " has no form for this processor alone");
        launcher_.run_whole("apetrei.runs", in_.count, [&] {
            const NeighbourPrefixes prefixes(SortedKeys<Key>{in_.keys, in_.count},
                                             memory_.climb.prefixes);
            const ApetreiTree tree = build_apetrei_cpu(
                prefixes, max_leaf_, [&](std::size_t k) { return Box3::load(boxes_[k]); },
                memory_.nodes, memory_.climb);
            result_.inner_count = tree.inner;
            result_.max_depth = tree.max_depth;
        });
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
        if (scratch_.levels.limit == 0) {
            memory_.ranks.reset(limit_);
            scratch_.levels =
                launch_find_levels(launcher_, out_.nodes, limit_, memory_.ranks.data(),
                                   make_levels(level_limit(), scratch_));
        }
        launch_fit_levels(launcher_, leaf_box_, out_.nodes, out_.parent_slot, limit_,
                          scratch_.levels, make_scratch<FitLevelsScratch>(limit_),
                          &result_.max_depth);
    }

    CountedBuild result_;
    std::span<const Key> keys_;
    std::span<const Aabb> boxes_;
    int max_leaf_;
    LbvhInput<Key> in_;
    std::uint32_t limit_;
    LeafBox leaf_box_;
    HostLauncher<Probe> launcher_;
    CountedMemory& memory_;
    HierarchyScratch& scratch_;
    TreeLinks out_{};
};

}  // namespace

template <class Key>
CountedBuild count_build(const BuildWay& way, std::span<const Key> keys,
                         std::span<const Aabb> leaf_boxes, int max_leaf, CountedMemory& memory) {
    return CountedRun<Key, CountProbe>(keys, leaf_boxes, max_leaf, memory).run(way);
}

template <class Key>
CountedBuild time_build(const BuildWay& way, std::span<const Key> keys,
                        std::span<const Aabb> leaf_boxes, int max_leaf, CountedMemory& memory) {
    return CountedRun<Key, NoProbe>(keys, leaf_boxes, max_leaf, memory).run(way);
}

template CountedBuild count_build(const BuildWay&, std::span<const std::uint32_t>,
                                  std::span<const Aabb>, int, CountedMemory&);
template CountedBuild count_build(const BuildWay&, std::span<const std::uint64_t>,
                                  std::span<const Aabb>, int, CountedMemory&);
template CountedBuild time_build(const BuildWay&, std::span<const std::uint32_t>,
                                 std::span<const Aabb>, int, CountedMemory&);
template CountedBuild time_build(const BuildWay&, std::span<const std::uint64_t>,
                                 std::span<const Aabb>, int, CountedMemory&);

}  // namespace raydix
