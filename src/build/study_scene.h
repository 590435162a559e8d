// Stages and trees of the study around the builders of the LBVH family: codes, sort, octree and k-d
// tree as launches over one scene, counted (CountProbe) or timed (NoProbe).
#pragma once

#include <raydix/hierarchy_study.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "exec/host_launcher.h"
#include "keys/encode_launches.h"
#include "keys/host_encode.h"
#include "primitives/bounds.h"
#include "sort/radix_sort.h"
#include "tree/counted_builds.h"
#include "tree/kdtree.h"
#include "tree/octree.h"

namespace raydix {

/// Primitives whose reads are told to the probe.
template <class Source, class Probe>
struct CountedSource {
    Source source;
    [[nodiscard]] RAYDIX_HD bool readable(std::uint32_t i) const {
        Probe::bytes(sizeof(Triangle));
        Probe::step();
        return source.readable(i);
    }
    RAYDIX_HD bool box(std::uint32_t i, Aabb& box) const {
        Probe::bytes(3 * sizeof(Vec3));
        Probe::step();
        return source.box(i, box);
    }
};

/// Work whose writes are told to the probe.
template <class Work, class Probe>
struct CountedWrites {
    Work work;
    std::uint64_t bytes;
    RAYDIX_HD void operator()(std::uint32_t i) const {
        Probe::bytes(bytes);
        work(i);
    }
};

/// One scene and what its cases share; memory is kept from one run to the next.
template <class Key, class Source>
struct StudyScene {
    Source source;
    std::uint32_t n = 0, valid = 0;
    Aabb bounds{};
    Grid grid{};
    std::vector<Key> codes, keys;      // in the scene's order; sorted, the valid ones
    std::vector<std::uint32_t> order;  // scratch of the sort
    std::vector<Aabb> boxes;           // in key order
    CountedMemory memory;
    SortScratch<Key> sort_scratch;
    Buffer<std::byte> scratch;
    std::vector<Key> key_copy, sorted_copy;
    std::vector<std::uint32_t> ids, sorted_ids;
    std::vector<KdNode> kd_nodes;
    std::vector<OctreeNode> octree_nodes;
    std::vector<std::uint32_t> level_begin;

    StudyScene(const Source& from, std::uint32_t count, const Bounds& found)
        : source(from),
          n(count),
          valid(static_cast<std::uint32_t>(count - found.left_out)),
          bounds(found.box),
          grid(make_grid(found.box, CodeFormat<Key>::axis_bits)),
          codes(count),
          order(count) {
        host_encode(source, grid, valid == n, n, codes.data());
        keys = codes;
        sort_keys<Key>(keys, order, static_cast<int>(8 * sizeof(Key)), sort_scratch);
        keys.resize(valid);
        boxes.resize(valid);
        for_each_index(valid, [&](std::size_t k) { source.box(order[k], boxes[k]); });
    }

    template <class T>
    T take_from(Arena& arena, const auto& take) {
        Arena size;
        static_cast<void>(take(size));
        scratch.reset(size.bytes());
        arena = Arena(scratch.data(), scratch.size());
        return take(arena);
    }
};

template <class Key, class Source, class Probe>
class StageRun {
public:
    StageRun(StudyScene<Key, Source>& scene, const StudyOptions& options)
        : scene_(scene), options_(options), launcher_(&result_.launches) {}

    CountedBuild run(const StudyCase& what) {
        const bool tuned = what.form == StudyForm::tuned;
        if (what.subject == "codes")
            tuned ? codes_tuned() : codes();
        else if (what.subject == "sort")
            tuned ? sort_tuned() : sort();
        else if (what.subject == "octree")
            octree();
        else
            kdtree();
        return std::move(result_);
    }

private:
    void codes() {
        using Reads = CountedSource<Source, Probe>;
        const Reads source{scene_.source};
        scene_.key_copy.resize(scene_.n);
        scene_.ids.resize(scene_.n);
        auto* bounds = scene_.template take_from<BoundsPart*>(arena_, [&](Arena& arena) {
            scratch_ = BoundsScratch(arena);
            return arena.take<BoundsPart>(1);
        });
        launch_bounds(launcher_, source, scene_.n, scratch_, bounds);
        using Encode = EncodeInScene<Reads, Key>;
        launcher_.launch("keys.encode", scene_.n,
                         CountedWrites<Encode, Probe>{
                             {source, bounds, scene_.key_copy.data(), scene_.ids.data()},
                             sizeof(Key) + sizeof(std::uint32_t)});
    }
    void codes_tuned() {
        scene_.key_copy.resize(scene_.n);
        launcher_.run_whole("codes.host", scene_.n, [&] {
            const Bounds bounds = scene_bounds(scene_.source, scene_.n);
            host_encode(scene_.source, make_grid(bounds.box, CodeFormat<Key>::axis_bits),
                        bounds.left_out == 0, scene_.n, scene_.key_copy.data());
        });
    }

    void copy_unsorted() {
        scene_.key_copy = scene_.codes;
        scene_.ids.resize(scene_.n);
        for (std::uint32_t i = 0; i < scene_.n; ++i) scene_.ids[i] = i;
    }
    void sort() {
        copy_unsorted();
        scene_.sorted_copy.resize(scene_.n);
        scene_.sorted_ids.resize(scene_.n);
        launcher_.sort_pairs("sort",
                             SortArrays<Key>{scene_.key_copy.data(), scene_.ids.data(),
                                             scene_.sorted_copy.data(), scene_.sorted_ids.data()},
                             scene_.n, nullptr, static_cast<int>(8 * sizeof(Key)));
    }
    void sort_tuned() {
        copy_unsorted();
        launcher_.run_whole("sort.host", scene_.n, [&] {
            sort_keys<Key>(scene_.key_copy, scene_.ids, static_cast<int>(8 * sizeof(Key)),
                           scene_.sort_scratch);
        });
    }

    void octree() {
        const OctreeRule rule{CodeFormat<Key>::axis_bits,
                              static_cast<std::uint32_t>(options_.max_leaf)};
        const std::uint32_t n = scene_.valid;
        auto radix = scene_.template take_from<RadixChains<Key, Probe>>(
            arena_, [&](Arena& arena) { return take_radix_chains<Key, Probe>(arena, n, rule); });
        count_octree(launcher_, scene_.keys.data(), &n, n, radix);
        result_.inner_count = *radix.node_count;
        Arena size;
        static_cast<void>(take_chain_order(size, result_.inner_count));
        // Behind the radix tree, which it reads.
        scene_.memory.scratch.memory.reset(size.bytes());
        Arena arena(scene_.memory.scratch.memory.data(), size.bytes());
        scene_.octree_nodes.resize(result_.inner_count);
        scene_.level_begin.assign(static_cast<std::size_t>(rule.max_level) + 2, 0);
        emit_octree(launcher_, n, radix, take_chain_order(arena, result_.inner_count),
                    scene_.octree_nodes.data(), scene_.level_begin.data());
    }

    void kdtree() {
        const std::uint32_t n = scene_.valid;
        if (n < 2) return;
        const std::uint32_t limit =
            inner_node_limit(n, static_cast<std::uint32_t>(options_.max_leaf));
        KdFitScratch fit{};
        const auto ranges = scene_.template take_from<KdRanges>(arena_, [&](Arena& arena) {
            fit = KdFitScratch::take(arena, limit);
            return KdRanges::take(arena, n);
        });
        const KdKeys<Key> keys{scene_.keys.data(), n, &n, &scene_.grid,
                               static_cast<std::uint32_t>(options_.max_leaf)};
        scene_.kd_nodes.resize(2 * std::size_t{limit} + 2);
        find_kd_ranges(launcher_, keys, ranges);
        result_.inner_count = *ranges.inner;
        emit_kd_nodes(launcher_, keys, ranges, fit, LeafBoxOfBoxes<Probe>{scene_.boxes.data()},
                      scene_.kd_nodes.data(), &result_.max_depth);
    }

    StudyScene<Key, Source>& scene_;
    const StudyOptions& options_;
    CountedBuild result_;
    HostLauncher<Probe> launcher_;
    Arena arena_;
    Arena nothing_;
    BoundsScratch scratch_{nothing_};
};

}  // namespace raydix
