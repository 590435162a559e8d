// The build of a GPU (gpu/device_build.h) on the host, by any launcher, as a Bvh that can be
// compared.
#pragma once

#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/device.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "exec/launch_sizer.h"
#include "gpu/device_build.h"
#include "support/guarded_memory.h"
#include "support/shuffled_launcher.h"
#include "tree/bvh_internals.h"

namespace raydix::test {

/// Runs nothing: for the sizes. Its scans and sort need no memory either.
struct IdleLauncher : LaunchSizer {
    void exclusive_scan(const char*, std::uint32_t*, std::uint32_t, std::uint32_t*) {}
    void exclusive_scan_counted(const char*, std::uint32_t*, const std::uint32_t*, std::uint32_t) {}
    void exclusive_scan_wide(const char*, std::uint64_t*, std::uint32_t) {}
    template <class Key>
    void sort_pairs(const char*, const SortArrays<Key>&, std::uint32_t, const std::uint32_t*, int) {
    }
};

/// Scratch of exactly this size, filled with `garbage`, between pages that nobody may touch. One
/// in two ends where such a page begins, the others begin where one ends.
struct LentMemory {
    GuardedMemory memory;
    Arena arena;

    LentMemory(std::size_t size, unsigned char garbage)
        : memory(size, std::byte{garbage}, next_side()), arena(memory.data(), size) {
        // Arrays of a device's builds begin at whole lines.
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory.data()) % Arena::alignment, 0u);
    }

    /// All of it was given out, and nothing around it was written.
    void expect_exact_use() const {
        EXPECT_EQ(arena.bytes(), memory.size());
        EXPECT_TRUE(memory.slack_untouched());
    }

private:
    static GuardedMemory::Exact next_side() {
        static std::atomic<unsigned> made{0};
        return made++ % 2 == 0 ? GuardedMemory::Exact::end : GuardedMemory::Exact::begin;
    }
};

/// All that a build leaves behind. Memory is filled with `garbage` before, as a rebuild in place
/// would find it.
struct LaunchedBuild {
    std::vector<BvhNode> nodes;
    std::vector<std::uint32_t> order, pair_ids;
    std::vector<LeafTriangle> triangles;
    std::vector<Aabb> boxes;
    std::vector<Vec3> points;
    std::vector<NodePair> pairs;
    DeviceCounts counts{};
    Bvh bvh;

    template <class Launcher, class Input>
    LaunchedBuild(Launcher& launcher, const Input& input, std::uint32_t n, PrimitiveKind kind,
                  const BuildOptions& options, unsigned char garbage = 0xA5) {
        resize(nodes, device_node_capacity(n, options), garbage);
        resize(pairs, device_pair_capacity(n, options), garbage);
        resize(order, n, garbage);
        resize(pair_ids, n, garbage);
        resize(triangles, kind == PrimitiveKind::triangles ? n : 0, garbage);
        resize(boxes, kind == PrimitiveKind::boxes ? n : 0, garbage);
        resize(points, kind == PrimitiveKind::points ? n : 0, garbage);
        const DeviceTree tree{nodes.data(),  order.data(), triangles.data(), boxes.data(),
                              points.data(), &counts,      pairs.data(),     pair_ids.data()};
        with_device_build(input, options, tree, [&](const auto& build) {
            Arena sizing = sizing_arena();
            IdleLauncher idle;
            build.run(idle, sizing);
            LentMemory memory(sizing.bytes(), garbage);
            build.run(launcher, memory.arena);
            memory.expect_exact_use();
        });
        make_bvh(kind, options);
    }

private:
    template <class T>
    static void resize(std::vector<T>& values, std::size_t size, unsigned char garbage) {
        values.resize(size);
        if (size != 0) std::memset(static_cast<void*>(values.data()), garbage, size * sizeof(T));
    }
    template <class T>
    static void take(Buffer<T>& out, const std::vector<T>& from, std::size_t size) {
        out.reset(size);
        std::copy_n(from.begin(), size, out.data());
    }
    void make_bvh(PrimitiveKind kind, const BuildOptions& options) {
        const BvhInternals access{bvh};
        access.kind() = kind;
        access.options() = options;
        access.input_count() = counts.input_count;
        access.left_out() = counts.left_out + counts.unreadable;
        access.inner_count() = counts.inner_count;
        access.max_depth() = counts.max_depth;
        const std::size_t n = counts.references;
        if (n == 0) return;
        take(access.nodes(), nodes, 2 * std::size_t{counts.inner_count} + 2);
        take(access.order(), order, n);
        if (kind == PrimitiveKind::triangles) take(access.triangles(), triangles, n);
        if (kind == PrimitiveKind::boxes) take(access.boxes(), boxes, n);
        if (kind == PrimitiveKind::points) take(access.points(), points, n);
    }
};

template <class Launcher>
LaunchedBuild launched_build(Launcher& launcher, const MeshView& mesh,
                             const BuildOptions& options) {
    const auto vertices = static_cast<std::uint32_t>(mesh.vertices.size());
    const auto triangles = static_cast<std::uint32_t>(mesh.triangles.size());
    return {launcher, DeviceMesh{mesh.vertices.data(), vertices, mesh.triangles.data(), triangles},
            triangles != 0 ? triangles : vertices,
            triangles != 0 ? PrimitiveKind::triangles : PrimitiveKind::points, options};
}
template <class Launcher>
LaunchedBuild launched_build(Launcher& launcher, std::span<const Aabb> boxes,
                             const BuildOptions& options) {
    const auto n = static_cast<std::uint32_t>(boxes.size());
    return {launcher, DeviceBoxList{boxes.data(), n}, n, PrimitiveKind::boxes, options};
}

}  // namespace raydix::test
