// The kernels of kernels.cuh on a device against the same functions on the host and the library's
// tree: every bit. Exit code 77: no device, nothing was compared.
#include <raydix/raydix.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "device/kernels.cuh"

namespace raydix::device_test {
namespace {

constexpr int skipped = 77;
constexpr std::uint32_t seed = 20120625;

void require(cudaError_t status, const char* what) {
    if (status != cudaSuccess)
        throw std::runtime_error(std::string(what) + ": " + cudaGetErrorString(status));
}

/// A copy of a host array in device memory.
template <class T>
class DeviceArray {
public:
    explicit DeviceArray(const std::vector<T>& values) : size_(values.size()) {
        require(cudaMalloc(&data_, size_ * sizeof(T)), "cudaMalloc");
        require(cudaMemcpy(data_, values.data(), size_ * sizeof(T), cudaMemcpyHostToDevice),
                "copy to the device");
    }
    DeviceArray(const DeviceArray&) = delete;
    DeviceArray& operator=(const DeviceArray&) = delete;
    ~DeviceArray() { cudaFree(data_); }

    [[nodiscard]] T* data() const { return data_; }
    [[nodiscard]] std::vector<T> read() const {
        std::vector<T> values(size_);
        require(cudaMemcpy(values.data(), data_, size_ * sizeof(T), cudaMemcpyDeviceToHost),
                "copy from the device");
        return values;
    }

private:
    T* data_ = nullptr;
    std::size_t size_;
};

template <class Work>
void launch(void (*kernel)(Work, std::uint32_t), const Work& work, std::uint32_t n) {
    kernel<<<(n + 127) / 128, 128>>>(work, n);
    require(cudaGetLastError(), "launch");
    require(cudaDeviceSynchronize(), "kernel");
}

template <class Work>
void on_host(const Work& work, std::uint32_t n) {
    for (std::uint32_t i = 0; i < n; ++i) work(i);
}

/// Prints how many elements differ; elements hold no padding.
template <class T>
bool same(const char* what, const std::vector<T>& device, const std::vector<T>& host) {
    std::size_t different = 0;
    for (std::size_t i = 0; i < host.size(); ++i)
        different += std::memcmp(&device[i], &host[i], sizeof(T)) != 0;
    std::printf("%-24s %8zu compared, %zu different\n", what, host.size(), different);
    return different == 0 && !host.empty() && device.size() == host.size();
}

/// Triangles on a coarse raster with small offsets: shared corners, equal codes, all sizes.
Mesh make_mesh(std::uint32_t triangles, std::mt19937& random) {
    std::uniform_int_distribution<int> raster(0, 40);
    std::uniform_real_distribution<float> offset(-2.0f, 2.0f);
    Mesh mesh;
    for (std::uint32_t i = 0; i < triangles; ++i) {
        const Vec3 at{float(raster(random)), float(raster(random)), float(raster(random))};
        for (int k = 0; k < 3; ++k)
            mesh.vertices.push_back(
                {at.x + offset(random), at.y + offset(random), at.z + offset(random)});
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    for (std::uint32_t i = 0; i < triangles / 10; ++i) mesh.triangles[10 * i] = mesh.triangles[0];
    return mesh;
}

/// Random rays, and some along the axes, with denormal and very long directions, and invalid ones.
std::vector<Ray> make_rays(std::uint32_t count, std::mt19937& random) {
    std::uniform_real_distribution<float> place(-20.0f, 60.0f), part(-1.0f, 1.0f);
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < count; ++i) {
        Ray ray{{place(random), place(random), place(random)},
                0.0f,
                {part(random), part(random), part(random)},
                infinity};
        const float scale = i % 7 == 0 ? 0x1p-130f : i % 7 == 1 ? 0x1p120f : 1.0f;
        ray.direction = ray.direction * scale;
        if (i % 5 == 0) ray.direction.x = -0.0f;
        if (i % 10 == 0) ray.direction.z = 0.0f;
        if (i % 100 == 0) ray.direction = {0.0f, 0.0f, 0.0f};
        rays.push_back(ray);
    }
    return rays;
}

template <class Key, class Source, class Kernel>
bool compare_codes(const char* what, Kernel kernel, Source host_source, Source device_source,
                   const Aabb& bounds, std::uint32_t n) {
    const Grid grid = make_grid(bounds, CodeFormat<Key>::axis_bits);
    std::vector<Key> codes(n);
    const DeviceArray<Key> device_codes(codes);
    on_host(EncodeMorton<Source, Key>{host_source, grid, codes.data()}, n);
    launch(kernel, EncodeMorton<Source, Key>{device_source, grid, device_codes.data()}, n);
    return same(what, device_codes.read(), codes);
}

bool compare_all_codes(const Mesh& mesh, const Aabb& bounds) {
    const DeviceArray<Vec3> vertices(mesh.vertices);
    const DeviceArray<Triangle> triangles(mesh.triangles);
    std::vector<Aabb> boxes;
    for (const Triangle& t : mesh.triangles)
        boxes.push_back(box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]));
    const DeviceArray<Aabb> device_boxes(boxes);
    const TriangleSource host{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const TriangleSource device{vertices.data(), triangles.data(), mesh.vertices.size()};
    const auto n = static_cast<std::uint32_t>(mesh.triangles.size());
    bool good = compare_codes<std::uint32_t>("codes of 30 bits", encode_triangles_30, host, device,
                                             bounds, n);
    good &= compare_codes<std::uint64_t>("codes of 63 bits", encode_triangles_63, host, device,
                                         bounds, n);
    good &= compare_codes<std::uint64_t>("codes of boxes", encode_boxes_63, BoxSource{boxes.data()},
                                         BoxSource{device_boxes.data()}, bounds, n);
    good &= compare_codes<std::uint64_t>("codes of points", encode_points_63,
                                         PointSource{mesh.vertices.data()},
                                         PointSource{vertices.data()}, bounds, n);
    return good;
}

/// Hierarchy and boxes on the device, from sorted codes, against the library's own tree.
template <class Key, class Kernel>
bool compare_trees(const char* what, Kernel find_kernel, const Mesh& mesh, int bits) {
    const Bvh tree = build_bvh(mesh, {.bits = bits, .max_leaf = 1});
    const auto n = static_cast<std::uint32_t>(tree.order().size()), inner = n - 1;
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    std::vector<Key> by_id(mesh.triangles.size()), keys;
    on_host(
        EncodeMorton<TriangleSource, Key>{
            source, make_grid(tree.bounds(), CodeFormat<Key>::axis_bits), by_id.data()},
        static_cast<std::uint32_t>(by_id.size()));
    for (const std::uint32_t id : tree.order()) keys.push_back(by_id[id]);

    const DeviceArray<Key> device_keys(keys);
    const DeviceArray<RadixRange> ranges(std::vector<RadixRange>(inner, RadixRange{0, 0, 0}));
    launch(find_kernel, FindRange<Key>{{device_keys.data(), n}, ranges.data()}, inner);
    std::vector<RadixRange> host_ranges(inner);
    on_host(FindRange<Key>{{keys.data(), n}, host_ranges.data()}, inner);
    bool good = same("ranges", ranges.read(), host_ranges);

    std::vector<std::uint64_t> bits_kept((inner + 63) / 64, ~std::uint64_t{0});
    std::vector<std::uint32_t> before(bits_kept.size());
    for (std::size_t w = 0; w < before.size(); ++w) before[w] = static_cast<std::uint32_t>(64 * w);
    std::vector<BvhNode> start(2 * std::size_t{inner} + 2, BvhNode{{0, 0, 0}, 0, {0, 0, 0}, 0});
    start[0].first = pair_slot(0);
    const DeviceArray<std::uint64_t> kept(bits_kept);
    const DeviceArray<std::uint32_t> kept_before(before),
        parents(std::vector<std::uint32_t>(inner, 0u)), depth(std::vector<std::uint32_t>(1, 0u));
    const DeviceArray<BvhNode> nodes(start);
    launch(emit_radix_node,
           EmitFromRange{{{kept.data(), kept_before.data()}, 1, nodes.data(), parents.data()},
                         ranges.data()},
           inner);

    const DeviceArray<LeafTriangle> copies(
        std::vector<LeafTriangle>(tree.triangles().begin(), tree.triangles().end()));
    const DeviceArray<std::uint8_t> meeting(
        std::vector<std::uint8_t>((inner + 3) / 4 * 4, std::uint8_t{0}));
    launch(
        fit_boxes,
        FitTriangles{{copies.data()}, nodes.data(), parents.data(), meeting.data(), depth.data()},
        inner);
    good &=
        same(what, nodes.read(), std::vector<BvhNode>(tree.nodes().begin(), tree.nodes().end()));
    good &= same("depth", depth.read(), std::vector<std::uint32_t>{tree.max_depth()});
    return good;
}

bool compare_rays(const Mesh& mesh, const Aabb& bounds, const std::vector<Ray>& rays) {
    std::vector<LeafTriangle> corners;
    for (const Triangle& t : mesh.triangles)
        corners.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    const std::vector<BvhNode> root{{bounds.lo, 0, bounds.hi, 0}};
    const DeviceArray<BvhNode> device_root(root);
    const auto n = static_cast<std::uint32_t>(rays.size());
    std::vector<RayAnswer> host(rays.size(), RayAnswer{TreeHit{}, 0, {0.0f, 0.0f}});
    const DeviceArray<RayAnswer> device(host);
    const DeviceArray<Ray> device_rays(rays);
    const DeviceArray<LeafTriangle> device_corners(corners);
    const auto count = static_cast<std::uint32_t>(corners.size());
    on_host(AnswerRay{rays.data(), corners.data(), count, root.data(), host.data()}, n);
    launch(answer_ray,
           AnswerRay{device_rays.data(), device_corners.data(), count, device_root.data(),
                     device.data()},
           n);
    const auto hits =
        std::count_if(host.begin(), host.end(), [](const RayAnswer& a) { return a.closest.hit(); });
    std::printf("%zu rays, %zu of them hit\n", rays.size(), static_cast<std::size_t>(hits));
    return same("rays", device.read(), host) && hits > 0;
}

int run() {
    int devices = 0;
    const cudaError_t status = cudaGetDeviceCount(&devices);
    if (status != cudaSuccess || devices == 0) {
        std::printf("skipped: no CUDA device (%s)\n", cudaGetErrorString(status));
        return skipped;
    }
    std::printf("seed %u\n", seed);
    std::mt19937 random(seed);
    const Mesh mesh = make_mesh(3000, random);
    const Aabb bounds = build_bvh(mesh).bounds();
    bool good = compare_all_codes(mesh, bounds);
    good &= compare_trees<std::uint32_t>("nodes, 30 bits", find_range_30, mesh, 30);
    good &= compare_trees<std::uint64_t>("nodes, 63 bits", find_range_63, mesh, 63);
    good &= compare_rays(mesh, bounds, make_rays(20000, random));
    return good ? 0 : 1;
}

}  // namespace
}  // namespace raydix::device_test

int main() {
    try {
        return raydix::device_test::run();
    } catch (const std::exception& error) {
        std::printf("%s\n", error.what());
        return 1;
    }
}
