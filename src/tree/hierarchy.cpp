#include "tree/hierarchy.h"

#include <raydix/error.h>

#include <new>
#include <string>

#include "exec/host_launcher.h"
#include "tree/apetrei.h"
#include "tree/garanzha.h"
#include "tree/karras.h"
#include "tree/lauterbach.h"

namespace raydix {
namespace {

/// Scratch of a builder that runs as launches, in memory that is kept.
template <class Scratch, class... Sizes>
Scratch make_scratch(Buffer<std::byte>& memory, Sizes... sizes) {
    memory.reset(scratch_bytes<Scratch>(sizes...));
    Arena arena(memory.data(), memory.size());
    return Scratch{arena, sizes...};
}

template <class Key>
struct LaunchRun {
    LbvhInput<Key> in;
    TreeLinks out;
    HierarchyScratch& scratch;
    HostLauncher<> launcher;

    [[nodiscard]] std::uint32_t level_limit() const {
        return lbvh_depth_bound(CodeFormat<Key>::bits, in.count);
    }
    void lauterbach() {
        scratch.levels = make_levels(level_limit(), scratch);
        const std::uint32_t width =
            lauterbach_band_width(in.count, level_limit(), lauterbach_memory_limit(in.count));
        const auto bytes = scratch_bytes<LauterbachScratch>(in.count, level_limit(), width);
        try {
            scratch.memory.reset(bytes);
        } catch (const std::bad_alloc&) {
            throw InputError("builder lauterbach needs " + std::to_string(bytes) +
                             " bytes for its split lists, which this machine does not give");
        }
        launch_lauterbach(
            launcher, in,
            make_scratch<LauterbachScratch>(scratch.memory, in.count, level_limit(), width), out,
            scratch.levels);
    }
    void garanzha() {
        scratch.levels = make_levels(level_limit(), scratch);
        launch_garanzha(
            launcher, in,
            make_scratch<GaranzhaScratch>(scratch.memory, in.count, in.max_leaf, level_limit()),
            out, scratch.levels);
    }
    void apetrei() {
        std::uint32_t depth = 0;  // the fit says it again
        launch_apetrei(launcher, in,
                       make_scratch<ApetreiScratch>(scratch.memory, in.count, in.max_leaf),
                       NoLeafBox{}, out, &depth);
    }
};

}  // namespace

TreeLevels make_levels(std::uint32_t limit, HierarchyScratch& scratch) {
    scratch.level_memory.reset(2 * (std::size_t{limit} + 1));
    std::uint32_t* memory = scratch.level_memory.data();
    return {memory, memory + limit + 1, limit, nullptr};
}

template <class Key>
std::uint32_t build_hierarchy(Builder builder, std::span<const Key> keys, int max_leaf,
                              Buffer<BvhNode>& nodes, HierarchyScratch& scratch) {
    scratch.levels = {};
    if (builder == Builder::karras) return build_karras(keys, max_leaf, nodes, scratch);
    if (!in_lbvh_family(builder))
        throw InputError("builder " + std::string(builder_name(builder)) + " does not run here");

    const LbvhInput<Key> in{keys.data(), static_cast<std::uint32_t>(keys.size()),
                            static_cast<std::uint32_t>(max_leaf)};
    const std::uint32_t limit = inner_node_limit(in.count, in.max_leaf);
    nodes.reset(2 * std::size_t{limit} + 2);
    scratch.parent_slot.reset(limit);
    std::uint32_t inner = 0;
    LaunchRun<Key> run{
        in, {nodes.data(), scratch.parent_slot.data(), &inner}, scratch, HostLauncher<>()};
    switch (builder) {
        case Builder::lauterbach:
            run.lauterbach();
            break;
        case Builder::garanzha:
            run.garanzha();
            break;
        default:
            run.apetrei();
            break;
    }
    nodes.reset(2 * std::size_t{inner} + 2);
    return inner;
}

template std::uint32_t build_hierarchy(Builder, std::span<const std::uint32_t>, int,
                                       Buffer<BvhNode>&, HierarchyScratch&);
template std::uint32_t build_hierarchy(Builder, std::span<const std::uint64_t>, int,
                                       Buffer<BvhNode>&, HierarchyScratch&);

}  // namespace raydix
