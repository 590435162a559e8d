// build_kdtree: bounds -> codes -> sort -> radix ranges -> layout -> nodes and their intervals, one
// line each in KdBuildRun::run.
#include <raydix/error.h>
#include <raydix/kdtree.h>

#include "base/check.h"
#include "build/input_checks.h"
#include "build/octree_kdtree_options.h"
#include "exec/host_launcher.h"
#include "exec/memory.h"
#include "keys/host_encode.h"
#include "layout/leaf_order.h"
#include "measure/stopwatch.h"
#include "sort/radix_sort.h"
#include "tree/kdtree.h"
#include "tree/kdtree_internals.h"

namespace raydix {
namespace {

/// One build: a source of primitives, the copies that its leaves hold, and the key type.
template <class Key, class Source, class Copy>
struct KdBuildRun {
    const Source& source;
    std::uint32_t n;
    const char* kind_name;
    const KdTreeOptions& options;
    KdTreeInternals tree;
    Buffer<Copy>& copies;

    void run() {
        Stopwatch total, stage;
        BuildMs& ms = tree.build_ms();
        const Bounds bounds = scene_bounds(source, n);
        check_bounds(bounds, source, kind_name, options.strict);
        const auto valid = static_cast<std::uint32_t>(n - bounds.left_out);
        tree.input_count() = n;
        tree.left_out() = bounds.left_out;
        ms.bounds = stage.lap();
        if (valid == 0) return;
        tree.bounds() = bounds.box;

        Buffer<Key> codes(n);
        const Grid grid = make_grid(bounds.box, CodeFormat<Key>::axis_bits);
        host_encode(source, grid, valid == n, n, codes.data());
        ms.codes = stage.lap();

        sort(codes.span(), valid);
        ms.sort = stage.lap();

        const KdKeys<Key> keys{codes.data(), valid, &valid, &grid,
                               static_cast<std::uint32_t>(options.max_leaf)};
        HostLauncher<> launcher;
        Buffer<std::byte> range_memory;
        const KdRanges ranges = find_ranges(launcher, keys, range_memory);
        ms.hierarchy = stage.lap();

        copy_to_leaf_order(source, tree.order().view(), copies);
        ms.layout = stage.lap();

        emit(launcher, keys, ranges);
        ms.fit = stage.lap();
        ms.total = total.lap();
        RAYDIX_CHECK(tree.max_depth(), <=, static_cast<std::uint32_t>(options.bits) + 32);
    }

private:
    /// What is left out has the highest key: it sorts to the end and is cut off there.
    void sort(std::span<Key> codes, std::uint32_t valid) {
        SortScratch<Key> scratch;
        const int key_bits = valid == n ? CodeFormat<Key>::bits : static_cast<int>(8 * sizeof(Key));
        tree.order().reset(n);
        sort_keys(codes, tree.order().span(), key_bits, scratch);
        tree.order().reset(valid);
    }

    KdRanges find_ranges(HostLauncher<>& launcher, const KdKeys<Key>& keys,
                         Buffer<std::byte>& memory) {
        Arena size;
        (void)KdRanges::take(size, keys.limit);
        memory.reset(size.bytes());
        Arena arena(memory.data(), memory.size());
        const KdRanges ranges = KdRanges::take(arena, keys.limit);
        find_kd_ranges(launcher, keys, ranges);
        check_kd_inner(*ranges.inner, keys.limit);
        return ranges;
    }

    void emit(HostLauncher<>& launcher, const KdKeys<Key>& keys, const KdRanges& ranges) {
        const std::uint32_t inner = *ranges.inner;
        tree.inner_count() = inner;
        tree.nodes().reset(2 * std::size_t{inner} + 2);
        Arena size;
        (void)KdFitScratch::take(size, inner);
        Buffer<std::byte> memory(size.bytes());
        Arena arena(memory.data(), memory.size());
        emit_kd_nodes(launcher, keys, ranges, KdFitScratch::take(arena, inner),
                      LeafBoxOf<Copy>{copies.data()}, tree.nodes().data(), &tree.max_depth());
    }
};

template <class Source, class Copy>
void build(const Source& source, std::size_t n, const char* kind_name, KdTreeInternals tree,
           Buffer<Copy>& copies) {
    KdTreeOptions& options = tree.options();
    options = resolved(options, tree.kind(), n);
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    with_threads(options.threads, [&] {
        const auto count = static_cast<std::uint32_t>(n);
        if (options.bits == 30)
            KdBuildRun<std::uint32_t, Source, Copy>{source, count, kind_name, options, tree, copies}
                .run();
        else
            KdBuildRun<std::uint64_t, Source, Copy>{source, count, kind_name, options, tree, copies}
                .run();
    });
    tree.peak_bytes() = memory_count().peak() - before;
}

}  // namespace

KdTree build_kdtree(const MeshView& mesh, const KdTreeOptions& options) {
    KdTree tree;
    const KdTreeInternals access{tree};
    access.options() = options;
    if (mesh.triangles.empty()) {
        access.kind() = PrimitiveKind::points;
        build(PointSource{mesh.vertices.data()}, mesh.vertices.size(), "point", access,
              access.points());
    } else {
        access.kind() = PrimitiveKind::triangles;
        const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(),
                                    mesh.vertices.size()};
        build(source, mesh.triangles.size(), "triangle", access, access.triangles());
    }
    return tree;
}

KdTree build_kdtree(const Mesh& mesh, const KdTreeOptions& options) {
    return build_kdtree(MeshView(mesh), options);
}

KdTree build_kdtree(std::span<const Vec3> points, const KdTreeOptions& options) {
    return build_kdtree(MeshView(points, {}), options);
}

}  // namespace raydix
