// build_bvh: bounds -> codes -> sort -> hierarchy -> layout -> fit, one line each in BuildRun::run.
#include <raydix/bvh.h>
#include <raydix/error.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <span>
#include <utility>

#include "base/check.h"
#include "base/options.h"
#include "build/build_clusters.h"
#include "build/build_sah.h"
#include "build/bvh_builder_internals.h"
#include "build/input_checks.h"
#include "exec/host_launcher.h"
#include "exec/memory.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "keys/host_encode.h"
#include "layout/leaf_order.h"
#include "measure/stopwatch.h"
#include "primitives/bounds.h"
#include "primitives/centers.h"
#include "sort/radix_sort.h"
#include "tree/apetrei_cpu.h"
#include "tree/bvh_internals.h"
#include "tree/code_options.h"
#include "tree/fit.h"
#include "tree/fit_levels.h"
#include "tree/hierarchy.h"
#include "tree/lbvh_family.h"

namespace raydix {

struct BvhBuilder::Scratch {
    Buffer<std::uint32_t> codes30;
    Buffer<std::uint64_t> codes63;
    SortScratch<std::uint32_t> sort30;
    SortScratch<std::uint64_t> sort63;
    HierarchyScratch hierarchy;
    ClimbScratch apetrei;
    Buffer<std::uint8_t> meeting;
    ClusterScratch clusters;
    SweepScratch sweeps;
    TopScratch top;
};

namespace {

template <class Key, class Scratch>
auto& codes_of(Scratch& scratch) {
    if constexpr (sizeof(Key) == 4)
        return scratch.codes30;
    else
        return scratch.codes63;
}
template <class Key, class Scratch>
auto& sort_scratch_of(Scratch& scratch) {
    if constexpr (sizeof(Key) == 4)
        return scratch.sort30;
    else
        return scratch.sort63;
}

template <class Scratch>
std::uint64_t bytes_held(const Scratch& s, const BvhInternals& tree) {
    const auto sum = [](const auto&... buffer) {
        return (buffer.capacity_bytes() + ... + std::size_t{0});
    };
    return sum(s.codes30, s.codes63, s.sort30.records, s.sort30.spare, s.sort30.histogram,
               s.sort63.records, s.sort63.spare, s.sort63.histogram, s.hierarchy.prefixes,
               s.hierarchy.kept_bits, s.hierarchy.kept_before, s.hierarchy.parent_slot,
               s.hierarchy.memory, s.hierarchy.level_memory, s.apetrei.prefixes,
               s.apetrei.kept_bits, s.apetrei.kept_before, s.apetrei.pieces, s.apetrei.piece_counts,
               s.meeting) +
           s.clusters.capacity_bytes() + s.sweeps.capacity_bytes() + s.top.capacity_bytes() +
           sum(tree.nodes(), tree.order(), tree.triangles(), tree.boxes(), tree.points());
}

void check_options(const BuildOptions& options, std::size_t n) {
    check_enum("builder", options.builder, Builder::sbvh);
    check_enum("fit", options.fit, Fit::atomic);
    check_code_options(options);
    if (options.reinsertion_rounds < 0 || options.reinsertion_rounds > 255)
        throw InputError("build option reinsertion_rounds is " +
                         std::to_string(options.reinsertion_rounds) + "; it must be 0 to 255");
    if (n >= std::size_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
}

/// What a build may be asked for besides a tree over its input.
struct BuildRequest {
    const TakeClusters* take = nullptr;       // clusters are wanted, not a tree
    const SortedTaker* sorted = nullptr;      // sorted triangles are wanted
    const TriangleCorners* around = nullptr;  // the triangles that boxes are around
};

/// For its lifetime a buffer views memory of somebody else.
template <class T>
class Lent {
public:
    Lent(Buffer<T>& buffer, T* memory, std::size_t size) : buffer_(buffer) {
        buffer_ = Buffer<T>(nullptr, memory, size);
    }
    ~Lent() { buffer_ = {}; }
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;

private:
    Buffer<T>& buffer_;
};

/// One build: a source of primitives, the kind of copies its leaves hold, and the key type.
template <class Key, class Source, class Copy, class Scratch>
struct BuildRun {
    const Source& source;
    std::uint32_t n;
    const char* kind_name;
    const BuildOptions& options;
    const BuildRequest& request;
    Scratch& scratch;
    BvhInternals tree;
    Buffer<Copy>& copies;

    void run() {
        if constexpr (std::is_same_v<Source, TriangleSource>)
            if (request.sorted != nullptr) return sort_triangles();
        Stopwatch total, stage;
        BuildMs ms;
        const Bounds bounds = scene_bounds(source, n);
        check_bounds(bounds, source, kind_name, options.strict);
        const auto valid = static_cast<std::uint32_t>(n - bounds.left_out);
        tree.input_count() = n;
        tree.left_out() = bounds.left_out;
        ms.bounds = stage.lap();
        progress_at(0.03);
        if (valid == 0) return make_empty();

        if (in_one_pass(valid)) {
            build_in_one_pass(valid, bounds.box, ms);
            reinsert(ms);
            ms.total = total.lap();
            tree.build_ms() = ms;
            return;
        }
        if (sweeps(options.builder)) {
            const ProgressStage rest(0.03, 1);
            build_by_sweeps(source, n, valid, bounds.box, request.around, scratch.sweeps,
                            scratch.top, tree, copies, ms);
            ms.total = total.lap();
            tree.build_ms() = ms;
            return;
        }
        const std::span<Key> codes = borrow_sort_memory();
        const Grid grid = make_grid(bounds.box, CodeFormat<Key>::axis_bits);
        host_encode(source, grid, valid == n, n, codes.data());
        ms.codes = stage.lap();
        progress_at(0.06);

        // Primitives that are left out have the highest key: they sort to the end and are cut off
        // there.
        const int key_bits = valid == n ? CodeFormat<Key>::bits : static_cast<int>(8 * sizeof(Key));
        tree.order().reset(n);
        sort_keys(codes, tree.order().span(), key_bits, sort_scratch_of<Key>(scratch));
        tree.order().reset(valid);
        ms.sort = stage.lap();
        progress_at(0.2);

        const std::span<const Key> keys = codes.first(valid);
        if (grows_clusters(options.builder)) {
            const ProgressStage rest(0.2, 1);
            build_clusters(source, keys, scratch.clusters, scratch.top, request.take, tree, copies,
                           ms);
            ms.total = total.lap();
            tree.build_ms() = ms;
            return;
        }

        tree.inner_count() = build_hierarchy(options.builder, keys, options.max_leaf, tree.nodes(),
                                             scratch.hierarchy);
        ms.hierarchy = stage.lap();
        progress_at(0.4);

        copy_to_leaf_order(source, tree.order().view(), copies);
        ms.layout = stage.lap();
        progress_at(0.6);

        fit();
        ms.fit = stage.lap();
        progress_at(0.75);
        reinsert(ms);
        ms.total = total.lap();
        tree.build_ms() = ms;
    }

private:
    /// Sort records behind `offset` bytes of the memory of the leaf copies, which are written after
    /// the last use of the records; in memory of their own if the copies are too small.
    bool borrow_records(Buffer<SortRecord<Key>>& records, std::size_t offset) {
        copies.reset(n);
        if (n * sizeof(Copy) < offset + n * sizeof(SortRecord<Key>)) {
            records.reset(n);
            return false;
        }
        auto* memory = reinterpret_cast<std::byte*>(copies.data()) + offset;
        records = Buffer<SortRecord<Key>>(nullptr, reinterpret_cast<SortRecord<Key>*>(memory), n);
        return true;
    }
    /// Codes, in the same memory before them where there is room.
    std::span<Key> borrow_sort_memory() {
        if (borrow_records(sort_scratch_of<Key>(scratch).records, n * sizeof(Key)))
            return {reinterpret_cast<Key*>(copies.data()), n};
        Buffer<Key>& codes = codes_of<Key>(scratch);
        codes.reset(n);
        return codes.span();
    }

    /// apetrei writes leaf copies, links and boxes together.
    [[nodiscard]] bool in_one_pass(std::uint32_t valid) const {
        return options.builder == Builder::apetrei && options.fit != Fit::levels &&
               valid > static_cast<std::uint32_t>(options.max_leaf);
    }
    void build_in_one_pass(std::uint32_t valid, const Aabb& scene_box, BuildMs& ms) {
        Stopwatch stage;
        borrow_records(sort_scratch_of<Key>(scratch).records, 0);
        // Codes are made twice rather than stored.
        const HostGrid grid(make_grid(scene_box, CodeFormat<Key>::axis_bits));
        const NeighbourPrefixes prefixes = sort_to_prefixes(
            [&](std::size_t begin, std::size_t end, Key* out) {
                host_encode_range(source, grid, valid == n, begin, end, out);
            },
            valid);
        ms.sort = stage.lap();
        progress_at(0.4);
        copies.reset(valid);
        const CopyWithBox<Source, Copy> leaf_box{source, tree.order().view(), copies.data()};
        const ProgressStage climb(0.4, 0.75);
        const ApetreiTree built =
            build_apetrei_cpu(prefixes, options.max_leaf, leaf_box, tree.nodes(), scratch.apetrei);
        tree.inner_count() = built.inner;
        tree.max_depth() = built.max_depth;
        ms.hierarchy = stage.lap();
    }

    /// Once sorted, only the common prefixes of codes are kept: what is written, read and written
    /// again costs more time than arithmetic. load(begin, end, out) gives the codes; the records
    /// have their memory; on return tree.order() is complete.
    template <class Load>
    NeighbourPrefixes sort_to_prefixes(const Load& load, std::uint32_t valid) {
        SortScratch<Key>& sort_scratch = sort_scratch_of<Key>(scratch);
        tree.order().reset(n);
        NeighbourPrefixes prefixes(n, scratch.apetrei.prefixes);
        const auto take = [&](std::size_t begin, std::span<const SortRecord<Key>> sorted) {
            std::uint32_t* order = tree.order().data() + begin;
            for (std::size_t k = 0; k + 1 < sorted.size(); ++k) {
                order[k] = sorted[k].position;
                prefixes.set(begin + k, sorted[k].key, sorted[k + 1].key);
            }
            order[sorted.size() - 1] = sorted.back().position;
        };
        const int key_bits = valid == n ? CodeFormat<Key>::bits : static_cast<int>(8 * sizeof(Key));
        for (const std::size_t k : sort_on_the_way<Key>(n, key_bits, load, take, sort_scratch))
            if (k != 0 && k != n)
                prefixes.set(k - 1, sort_scratch.records[k - 1].key, sort_scratch.records[k].key);
        prefixes.end_at(valid);
        tree.order().reset(valid);
        return prefixes;
    }

    /// Sorts those that have an area, for request.sorted, whose memory holds the sort records, the
    /// codes and the centers of the boxes.
    void sort_triangles() {
        using Record = SortRecord<Key>;
        Stopwatch total, stage;
        BuildMs ms;
        const std::span<std::byte> memory =
            request.sorted->memory(n, n * (sizeof(Record) + sizeof(Key) + sizeof(Vec3)));
        auto* const codes = reinterpret_cast<Key*>(memory.data() + n * sizeof(Record));
        auto* const centers = reinterpret_cast<Vec3*>(codes + n);
        const Bounds bounds = scene_bounds(source, n, KeepCenters{source, centers});
        check_bounds(bounds, source, kind_name, options.strict);
        tree.input_count() = n;
        tree.left_out() = bounds.left_out;
        ms.bounds = stage.lap();
        progress_at(0.03);
        const auto valid = static_cast<std::uint32_t>(n - bounds.left_out - bounds.flat);
        if (valid != 0) {
            const Lent lent(sort_scratch_of<Key>(scratch).records,
                            reinterpret_cast<Record*>(memory.data()), n);
            host_encode(Centers{centers}, make_grid(bounds.box, CodeFormat<Key>::axis_bits),
                        valid == n, n, codes);
            const NeighbourPrefixes prefixes =
                sort_to_prefixes([&](std::size_t begin, std::size_t end,
                                     Key* out) { std::copy(codes + begin, codes + end, out); },
                                 valid);
            ms.sort = stage.lap();
            progress_at(0.4);
            const ProgressStage rest(0.4, 1);
            request.sorted->take({prefixes, tree.order().view(), source, bounds.box});
        }
        tree.make_empty();
        ms.total = total.lap();
        tree.build_ms() = ms;
    }

    /// Of a tree that is complete.
    void reinsert(BuildMs& ms) {
        if (options.reinsertion_rounds == 0) return;
        Stopwatch stage;
        const ProgressStage rest(0.75, 1);
        const bool changed =
            reinsert_finished(tree.nodes(), tree.order(), tree.max_depth(),
                              top_options(options.reinsertion_rounds), scratch.top);
        ms.hierarchy += stage.lap();
        if (changed) copy_to_leaf_order(source, tree.order().view(), copies);
        ms.layout += stage.lap();
    }

    void make_empty() {
        tree.make_empty();
        tree.build_ms() = {};
    }

    void fit() {
        const LeafBoxOf<Copy> leaf_box{copies.data()};
        const std::uint32_t inner = tree.inner_count();
        BvhNode* nodes = tree.nodes().data();
        if (inner == 0) {
            set_box(nodes[0], leaf_box(nodes[0].first, nodes[0].count));
            tree.max_depth() = 0;
            return;
        }
        if (fits_by_levels(options)) return fit_by_levels(leaf_box);
        scratch.meeting.reset(inner);
        std::uint8_t* meeting = scratch.meeting.data();
        for_each_range(inner, 1u << 16, [&](std::size_t begin, std::size_t end) {
            std::fill(meeting + begin, meeting + end, std::uint8_t{0});
        });
        const FitBoxes<LeafBoxOf<Copy>> fit_boxes{
            leaf_box, nodes, scratch.hierarchy.parent_slot.data(), meeting, &tree.max_depth()};
        for_each_index(inner,
                       [&](std::size_t rank) { fit_boxes(static_cast<std::uint32_t>(rank)); });
        RAYDIX_CHECK(tree.max_depth(), <=, static_cast<std::uint32_t>(options.bits) + 32);
    }

    /// The builder's levels if it made some, else those found from the root.
    void fit_by_levels(const LeafBoxOf<Copy>& leaf_box) {
        const std::uint32_t inner = tree.inner_count();
        HierarchyScratch& h = scratch.hierarchy;
        BvhNode* nodes = tree.nodes().data();
        HostLauncher<> launcher;
        Arena query;
        static_cast<void>(query.take<std::uint32_t>(inner));
        static_cast<void>(FitLevelsScratch(query, inner));
        h.memory.reset(query.bytes());
        Arena arena(h.memory.data(), h.memory.size());
        auto* ranks = arena.take<std::uint32_t>(inner);
        const FitLevelsScratch fit_scratch(arena, inner);
        if (h.levels.limit == 0) {
            const std::uint32_t limit = in_lbvh_family(options.builder)
                                            ? lbvh_depth_bound(options.bits, tree.order().size())
                                            : inner;
            h.levels = launch_find_levels(launcher, nodes, inner, ranks, make_levels(limit, h));
        }
        launch_fit_levels(launcher, leaf_box, nodes, h.parent_slot.data(), inner, h.levels,
                          fit_scratch, &tree.max_depth());
    }
};

template <class Source, class Copy, class Scratch>
void build(const Source& source, std::size_t n, const char* kind_name, PrimitiveKind kind,
           const BuildOptions& options, const BuildRequest& request, Scratch& scratch,
           BvhInternals tree, Buffer<Copy>& copies) {
    check_options(options, n);
    const std::uint64_t before = memory_count().now() - bytes_held(scratch, tree);
    memory_count().restart_peak();
    tree.kind() = kind;
    tree.options() = options;
    tree.refitted() = false;
    const auto run = [&] {
        const auto count = static_cast<std::uint32_t>(n);
        if (options.bits == 30)
            BuildRun<std::uint32_t, Source, Copy, Scratch>{source,  count,   kind_name, options,
                                                           request, scratch, tree,      copies}
                .run();
        else
            BuildRun<std::uint64_t, Source, Copy, Scratch>{source,  count,   kind_name, options,
                                                           request, scratch, tree,      copies}
                .run();
    };
    try {
        with_threads(options.threads, run);
    } catch (...) {
        tree.bvh = Bvh();  // nothing half-built gets out
        throw;
    }
    tree.peak_bytes() = memory_count().peak() - before;
}

template <class Scratch>
void build_mesh(const MeshView& mesh, const BuildOptions& options, const BuildRequest& request,
                Scratch& scratch, Bvh& out) {
    const bool points = mesh.triangles.empty();
    if (out.kind() != (points ? PrimitiveKind::points : PrimitiveKind::triangles)) out = Bvh();
    const BvhInternals tree{out};
    if (points) {
        build(PointSource{mesh.vertices.data()}, mesh.vertices.size(), "point",
              PrimitiveKind::points, options, request, scratch, tree, tree.points());
    } else {
        const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(),
                                    mesh.vertices.size()};
        build(source, mesh.triangles.size(), "triangle", PrimitiveKind::triangles, options, request,
              scratch, tree, tree.triangles());
    }
}

template <class Scratch>
void build_boxes(std::span<const Aabb> boxes, const BuildOptions& options,
                 const BuildRequest& request, Scratch& scratch, Bvh& out) {
    if (out.kind() != PrimitiveKind::boxes) out = Bvh();
    const BvhInternals tree{out};
    build(BoxSource{boxes.data()}, boxes.size(), "box", PrimitiveKind::boxes, options, request,
          scratch, tree, tree.boxes());
}

/// The tree's arrays, taken from it, if the input lies in them: a build would write over what it
/// reads.
Bvh arrays_below(const void* input, Bvh& tree) {
    const auto lies_in = [&](const auto& array) {
        const std::span<const std::byte> bytes = std::as_bytes(array);
        return !std::less<>{}(input, bytes.data()) &&
               std::less<>{}(input, bytes.data() + bytes.size());
    };
    if (lies_in(tree.points()) || lies_in(tree.boxes())) return std::move(tree);
    return {};
}

}  // namespace

BvhBuilder::BvhBuilder() : scratch_(std::make_unique<Scratch>()) {}
BvhBuilder::~BvhBuilder() = default;
BvhBuilder::BvhBuilder(BvhBuilder&&) noexcept = default;
BvhBuilder& BvhBuilder::operator=(BvhBuilder&&) noexcept = default;
BvhBuilder::Scratch& BvhBuilder::scratch() {
    if (!scratch_) scratch_ = std::make_unique<Scratch>();
    return *scratch_;
}

void BvhBuilderInternals::build_clusters(BvhBuilder& builder, const MeshView& mesh,
                                         const BuildOptions& options, Bvh& tree,
                                         const TakeClusters& take) {
    build_mesh(mesh, options, {.take = &take}, builder.scratch(), tree);
}

void BvhBuilderInternals::sort(BvhBuilder& builder, const MeshView& mesh,
                               const BuildOptions& options, Bvh& tree, const SortedTaker& take) {
    build_mesh(mesh, options, {.sorted = &take}, builder.scratch(), tree);
}

void BvhBuilderInternals::build_around(BvhBuilder& builder, std::span<const Aabb> boxes,
                                       const TriangleCorners& corners, const BuildOptions& options,
                                       Bvh& tree) {
    build_boxes(boxes, options, {.around = &corners}, builder.scratch(), tree);
}

void BvhBuilder::build(const MeshView& mesh, const BuildOptions& options, Bvh& tree) {
    const Bvh read = arrays_below(mesh.vertices.data(), tree);
    build_mesh(mesh, options, {}, scratch(), tree);
}

Bvh build_bvh(const MeshView& mesh, const BuildOptions& options) {
    Bvh tree;
    BvhBuilder().build(mesh, options, tree);
    return tree;
}

Bvh build_bvh(const Mesh& mesh, const BuildOptions& options) {
    return build_bvh(MeshView(mesh), options);
}

Bvh build_bvh(std::span<const Aabb> boxes, const BuildOptions& options) {
    Bvh tree;
    BvhBuilder builder;
    builder.build(boxes, options, tree);
    return tree;
}

void BvhBuilder::build(std::span<const Aabb> boxes, const BuildOptions& options, Bvh& tree) {
    const Bvh read = arrays_below(boxes.data(), tree);
    build_boxes(boxes, options, {}, scratch(), tree);
}

Bvh build_bvh(std::span<const Vec3> points, const BuildOptions& options) {
    return build_bvh(MeshView(points, {}), options);
}

}  // namespace raydix
