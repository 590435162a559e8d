// The H-PLOC kernel against its host twin: same keys and boxes in, same tree out. Skips (77)
// without a device.
#include <raydix/bvh.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <random>
#include <vector>

#include "base/math.h"
#include "tree/build_hploc.h"
#include "tree/hploc_cuda.cuh"
#include "tree/place_clusters.h"

namespace {

using namespace raydix;
using Key = std::uint64_t;

bool fine(cudaError_t error, const char* what) {
    if (error != cudaSuccess) std::fprintf(stderr, "%s: %s\n", what, cudaGetErrorString(error));
    return error == cudaSuccess;
}

/// Device memory of one test.
template <class T>
struct Device {
    T* data = nullptr;
    explicit Device(std::size_t n) {
        fine(cudaMalloc(&data, std::max<std::size_t>(n, 1) * sizeof(T)), "malloc");
    }
    Device(const std::vector<T>& v) : Device(v.size()) {
        fine(cudaMemcpy(data, v.data(), v.size() * sizeof(T), cudaMemcpyDefault), "copy");
    }
    ~Device() { cudaFree(data); }
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;
};

struct Input {
    std::vector<Key> keys;  // ascending
    std::vector<std::uint32_t> ids;
    std::vector<Aabb> boxes;
};

/// Codes of `bits` bits at random: few bits give many equal codes. Boxes have no relation to them.
Input make_input(std::uint32_t n, int bits, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    Input input;
    for (std::uint32_t k = 0; k < n; ++k) {
        input.keys.push_back(random() >> (64 - bits));
        input.ids.push_back(k);
        const Vec3 p{unit(), unit(), unit()};
        input.boxes.push_back({p, {p.x + unit(), p.y + unit(), p.z + unit()}});
    }
    std::sort(input.keys.begin(), input.keys.end());
    std::shuffle(input.ids.begin(), input.ids.end(), random);
    return input;
}

struct Tree {
    Buffer<BvhNode> nodes;
    Buffer<std::uint32_t> order;
    std::uint32_t depth = 0;
};

Tree place(const Input& input, const BoxLanes& lanes, const ClusterNode* nodes, ClusterRef root) {
    Tree tree;
    place_clusters({nodes, root, lanes, input.ids}, tree.nodes, tree.order, tree.depth);
    return tree;
}

Tree on_device(const Input& input, const BoxLanes& lanes) {
    const auto n = static_cast<std::uint32_t>(input.keys.size());
    Device<Key> keys(input.keys);
    Device<std::uint32_t> ids(input.ids), lists(n), meeting(n), claimed(1), root(1);
    Device<Aabb> boxes(input.boxes);
    Device<ClusterNode> nodes(n);
    launch_hploc<Key>({{keys.data, n},
                       ids.data,
                       {boxes.data},
                       4,
                       lists.data,
                       meeting.data,
                       nodes.data,
                       claimed.data,
                       root.data},
                      nullptr);
    fine(cudaGetLastError(), "launch");
    std::vector<ClusterNode> host_nodes(n);
    ClusterRef host_root = 0;
    fine(cudaMemcpy(host_nodes.data(), nodes.data, n * sizeof(ClusterNode), cudaMemcpyDefault),
         "nodes");
    fine(cudaMemcpy(&host_root, root.data, sizeof(host_root), cudaMemcpyDefault), "root");
    return place(input, lanes, host_nodes.data(), host_root);
}

Tree on_host(const Input& input, const BoxLanes& lanes) {
    Buffer<ClusterNode> nodes;
    HplocScratch scratch;
    const ClusterRef root = build_hploc<Key>(input.keys, input.ids, lanes, 4, nodes, scratch);
    return place(input, lanes, nodes.data(), root);
}

template <class T>
bool same(const Buffer<T>& a, const Buffer<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

}  // namespace

int main() {
    int devices = 0;
    if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
        std::puts("skipped: no CUDA device");
        return 77;
    }
    int failures = 0;
    for (const std::uint32_t n : {1u, 2u, 3u, 16u, 17u, 32u, 33u, 1000u, 100'000u, 1'000'000u})
        for (const int bits : {1, 12, 63}) {
            const std::uint64_t seed = n + static_cast<std::uint64_t>(bits);
            const Input input = make_input(n, bits, seed);
            BoxLanes lanes;
            lanes.reset(n);
            for (std::uint32_t k = 0; k < n; ++k) lanes.set(k, input.boxes[k]);
            const Tree host = on_host(input, lanes), device = on_device(input, lanes);
            const bool ok = same(host.nodes, device.nodes) && same(host.order, device.order) &&
                            host.depth == device.depth;
            std::printf("%8u primitives, %2d code bits, seed %llu: %s\n", n, bits,
                        static_cast<unsigned long long>(seed), ok ? "same tree" : "DIFFERENT");
            failures += !ok;
        }
    return failures != 0;
}
