// build_octree: bounds -> codes -> sort -> octree -> layout, one line each in OctreeRun::run.
#include <raydix/error.h>
#include <raydix/octree.h>

#include "build/input_checks.h"
#include "build/octree_kdtree_options.h"
#include "exec/host_launcher.h"
#include "exec/memory.h"
#include "keys/host_encode.h"
#include "measure/stopwatch.h"
#include "sort/radix_sort.h"
#include "tree/octree.h"
#include "tree/octree_internals.h"

namespace raydix {
namespace {

/// One build: a source of primitives, whose centres are the points, and the key type.
template <class Key, class Source>
struct OctreeRun {
    const Source& source;
    std::uint32_t n;
    const char* kind_name;
    OctreeInternals tree;

    void run() {
        Stopwatch total, stage;
        BuildMs ms;
        const Bounds bounds = scene_bounds(source, n);
        check_bounds(bounds, source, kind_name, tree.options().strict);
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

        build_nodes(codes.data(), valid);
        ms.hierarchy = stage.lap();

        copy_points();
        ms.layout = stage.lap();
        ms.total = total.lap();
        tree.build_ms() = ms;
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

    void build_nodes(const Key* codes, std::uint32_t valid) {
        HostLauncher<> launcher;
        const OctreeRule rule{tree.options().max_level,
                              static_cast<std::uint32_t>(tree.options().max_leaf)};
        Arena radix_size;
        (void)take_radix_chains<Key>(radix_size, valid, rule);
        Buffer<std::byte> radix_memory(radix_size.bytes());
        Arena radix_arena(radix_memory.data(), radix_memory.size());
        const auto radix = take_radix_chains<Key>(radix_arena, valid, rule);
        count_octree(launcher, codes, &valid, valid, radix);

        const std::uint32_t node_count = *radix.node_count;
        tree.nodes().reset(node_count);
        Arena order_size;
        (void)take_chain_order(order_size, node_count);
        Buffer<std::byte> order_memory(order_size.bytes());
        Arena order_arena(order_memory.data(), order_memory.size());
        const ChainOrder order = take_chain_order(order_arena, node_count);
        emit_octree(launcher, valid, radix, order, tree.nodes().data(), tree.level_begin().data());
        // A tree that ends above max_level has no nodes on the levels below.
        auto& begin = tree.level_begin();
        for (std::size_t k = static_cast<std::size_t>(rule.max_level) + 2; k < begin.size(); ++k)
            begin[k] = node_count;
    }

    void copy_points() {
        const std::span<const std::uint32_t> order = tree.order().view();
        tree.points().reset(order.size());
        Vec3* points = tree.points().data();
        for_each_index(order.size(), [&](std::size_t k) {
            Aabb box;
            source.box(order[k], box);
            points[k] = without_negative_zero(center_of(box));  // of two subnormals it may be -0
        });
    }
};

template <class Source>
Octree build(const Source& source, std::size_t n, PrimitiveKind kind, const char* kind_name,
             const OctreeOptions& given) {
    const OctreeOptions options = resolved(given, n);
    Octree octree;
    const OctreeInternals tree{octree};
    tree.kind() = kind;
    tree.options() = options;
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    with_threads(options.threads, [&] {
        const auto count = static_cast<std::uint32_t>(n);
        if (options.bits == 30)
            OctreeRun<std::uint32_t, Source>{source, count, kind_name, tree}.run();
        else
            OctreeRun<std::uint64_t, Source>{source, count, kind_name, tree}.run();
    });
    tree.peak_bytes() = memory_count().peak() - before;
    return octree;
}

}  // namespace

Octree build_octree(std::span<const Vec3> points, const OctreeOptions& options) {
    return build(PointSource{points.data()}, points.size(), PrimitiveKind::points, "point",
                 options);
}

Octree build_octree(const MeshView& mesh, const OctreeOptions& options) {
    if (mesh.triangles.empty()) return build_octree(mesh.vertices, options);
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    return build(source, mesh.triangles.size(), PrimitiveKind::triangles, "triangle", options);
}

Octree build_octree(const Mesh& mesh, const OctreeOptions& options) {
    return build_octree(MeshView(mesh), options);
}

}  // namespace raydix
