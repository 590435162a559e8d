// Octree and k-d tree on a device against the host's loops: every node. Exit code 77: no device,
// nothing was compared. Compiling this file shows that their launches are device code.
#include "support/core_trees.h"

#include <raydix/device.h>
#include <raydix/error.h>

#include <cstdio>
#include <cstring>
#include <exception>
#include <random>
#include <vector>

#include "api/device_build.h"
#include "exec/cuda_launcher.cuh"

namespace raydix::test {
namespace {

constexpr int skipped = 77;
constexpr std::uint64_t seed = 2012;

std::vector<Vec3> some_points(std::size_t n) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> place(-3.0f, 5.0f);
    std::vector<Vec3> points(n);
    for (std::size_t i = 0; i < n; ++i)
        points[i] =
            i % 3 == 1 ? points[i / 100] : Vec3{place(random), place(random), place(random)};
    return points;
}

struct HostTrees {
    std::vector<std::byte> memory;
    CoreTrees trees;
};

template <class Key>
HostTrees on_host(const SortedPoints<Key>& in, std::size_t bytes) {
    HostTrees host{std::vector<std::byte>(bytes + Arena::alignment), {}};
    void* start = host.memory.data();
    std::size_t space = host.memory.size();
    std::align(Arena::alignment, bytes, start, space);
    Arena arena(start, bytes);
    HostLauncher<> launcher;
    host.trees = build_core_trees(launcher, arena, in);
    return host;
}

template <class T>
std::vector<T> read(const T* device, std::size_t n) {
    std::vector<T> values(n);
    detail::copy_to_host(values.data(), device, n * sizeof(T), nullptr);
    synchronize(nullptr);
    return values;
}

template <class Key>
bool compare(const char* what, std::size_t n, int bits) {
    const Bvh bvh = build_bvh(std::span<const Vec3>(some_points(n)), {.bits = bits});
    const std::vector<Vec3> points(bvh.points().begin(), bvh.points().end());
    const Grid grid = make_grid(bvh.bounds(), CodeFormat<Key>::axis_bits);
    std::vector<Key> keys;
    for (const Vec3& p : points) keys.push_back(interleave<Key>(grid.cell(center_of(Aabb{p, p}))));
    const auto count = static_cast<std::uint32_t>(points.size());
    const SortedPoints<Key> host_in{keys.data(), points.data(), count, grid, 4};
    const DeviceBuffer<Key> device_keys{std::span<const Key>(keys)};
    const DeviceBuffer<Vec3> device_points{std::span<const Vec3>(points)};
    const SortedPoints<Key> device_in{device_keys.data(), device_points.data(), count, grid, 4};

    Arena sizing = sizing_arena();
    CudaSizer sizer;
    build_core_trees(sizer, sizing, device_in);
    const HostTrees host = on_host(host_in, sizing.bytes());
    const DeviceBuffer<std::byte> memory(sizing.bytes());
    const DeviceBuffer<std::byte> scratch(CudaLauncher::reserved_bytes + sizer.bytes());
    Arena arena(memory.data(), memory.size());
    CudaLauncher launcher(nullptr, scratch.data(), scratch.size());
    const CoreTrees trees = build_core_trees(launcher, arena, device_in);
    synchronize(nullptr);

    const std::uint32_t nodes = *host.trees.octree_count, inner = *host.trees.kd_inner;
    bool good = read(trees.octree_count, 1)[0] == nodes && read(trees.kd_inner, 1)[0] == inner &&
                read(trees.kd_depth, 1)[0] == *host.trees.kd_depth &&
                nodes <= trees.octree_capacity;
    std::size_t different = 0;
    const std::vector<OctreeNode> octree = read(trees.octree_nodes, nodes);
    for (std::uint32_t i = 0; i < nodes; ++i)
        different += !same(octree[i], host.trees.octree_nodes[i]);
    const std::size_t slots = 2 * std::size_t{inner} + 2;
    const std::vector<KdNode> kd = read(trees.kd_nodes, slots);
    for (std::size_t i = 0; i < slots; ++i)
        different += std::memcmp(&kd[i], &host.trees.kd_nodes[i], sizeof(KdNode)) != 0;
    std::printf("%s: %u octree nodes, %zu k-d slots, %zu different\n", what, nodes, slots,
                different);
    return good && different == 0;
}

int run() {
    if (!device_available()) {
        std::printf("skipped: no CUDA device\n");
        return skipped;
    }
    std::printf("seed %llu on %s\n", static_cast<unsigned long long>(seed), device_name().c_str());
    bool good = true;
    for (const std::size_t n : {5u, 1000u, 200'000u}) {
        good &= compare<std::uint32_t>("30 bits", n, 30);
        good &= compare<std::uint64_t>("63 bits", n, 63);
    }
    return good ? 0 : 1;
}

}  // namespace
}  // namespace raydix::test

int main() {
    try {
        return raydix::test::run();
    } catch (const std::exception& error) {
        std::printf("%s\n", error.what());
        return 1;
    }
}
