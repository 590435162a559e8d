// What this machine could do at best, by the plainest loops: the box of all vertices, codes of
// centroids already at hand, a plain least-significant-digit sort, a gather of boxes; and a triad
// for the memory's bandwidth.
#include <fmt/format.h>
#include <raydix/model.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "base/math.h"
#include "exec/parallel.h"
#include "keys/morton.h"
#include "measure/stopwatch.h"
#include "primitives/bounds.h"

namespace {

using namespace raydix;
using Json = nlohmann::ordered_json;

/// Median of five runs in milliseconds, after one to warm up.
template <class Body>
double time_ms(const Body& body) {
    body();
    std::array<double, 5> ms{};
    for (double& one : ms) {
        Stopwatch watch;
        body();
        one = watch.lap();
    }
    std::sort(ms.begin(), ms.end());
    return ms[2];
}

struct Pair {
    std::uint64_t key;
    std::uint32_t id;
};

/// Eight passes of eight bits (four for 30-bit codes), each counted and scattered per thread's
/// block.
void plain_radix_sort(std::vector<Pair>& from, std::vector<Pair>& to, int bits) {
    const std::size_t n = from.size(), blocks = static_cast<std::size_t>(thread_count());
    const std::size_t block = (n + blocks - 1) / blocks;
    std::vector<std::array<std::size_t, 256>> counts(blocks);
    for (int shift = 0; shift < bits; shift += 8) {
        for (auto& count : counts) count.fill(0);
        for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) ++counts[b][from[i].key >> shift & 255];
        });
        std::size_t sum = 0;
        for (std::size_t digit = 0; digit < 256; ++digit)
            for (auto& count : counts) sum += std::exchange(count[digit], sum);
        for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                to[counts[b][from[i].key >> shift & 255]++] = from[i];
        });
        std::swap(from, to);
    }
}

double triad_gb_per_s() {
    constexpr std::size_t n = 1u << 24;
    std::vector<float> a(n), b(n, 1.0f), c(n, 2.0f);
    const double ms = time_ms([&] {
        for_each_range(n, 1u << 16, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) a[i] = b[i] + 3.0f * c[i];
        });
    });
    return 3.0 * sizeof(float) * n / 1e6 / ms;
}

Json run(const std::string& spec, int threads) {
    const Mesh mesh = load_flat_model(spec).mesh();
    const std::size_t n = mesh.triangles.size();
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    std::vector<Aabb> boxes(n), gathered(n);
    std::vector<Vec3> centers(n);
    std::vector<std::uint64_t> codes(n);
    std::vector<Pair> pairs(n), sorted(n), spare(n);
    Json ms;
    double triad = 0;
    with_threads(threads, [&] {
        for_each_index(n, [&](std::size_t i) {
            source.box(static_cast<std::uint32_t>(i), boxes[i]);
            centers[i] = center_of(boxes[i]);
        });
        const Aabb scene = scene_bounds(source, static_cast<std::uint32_t>(n)).box;
        ms["bounds_of_vertices"] = time_ms([&] {
            static_cast<void>(scene_bounds(PointSource{mesh.vertices.data()},
                                           static_cast<std::uint32_t>(mesh.vertices.size())));
        });
        const Grid grid = make_grid(scene, 21);
        ms["codes_of_centers"] = time_ms([&] {
            for_each_index(
                n, EncodeMorton<PointSource, std::uint64_t>{{centers.data()}, grid, codes.data()});
        });
        for_each_index(n, [&](std::size_t i) {
            pairs[i] = {codes[i], static_cast<std::uint32_t>(i)};
        });
        ms["plain_sort_63"] = time_ms([&] {
            sorted = pairs;
            plain_radix_sort(sorted, spare, 63);
        });
        for_each_index(n, [&](std::size_t i) { pairs[i].key >>= 33; });
        std::vector<Pair> by_top;
        ms["plain_sort_30"] = time_ms([&] {
            by_top = pairs;
            plain_radix_sort(by_top, spare, 30);
        });
        ms["gather_of_boxes"] = time_ms(
            [&] { for_each_index(n, [&](std::size_t i) { gathered[i] = boxes[sorted[i].id]; }); });
        triad = triad_gb_per_s();
    });
    // Vertices and indices twice (bounds, codes), codes once out and once in, three sort passes of
    // 12 bytes in and out, leaf copies and about 0.7 nodes of 32 bytes a triangle once.
    const double bytes =
        2.0 * static_cast<double>(mesh.vertices.size() * sizeof(Vec3) + n * sizeof(Triangle)) +
        static_cast<double>(n) * (2 * 8 + 3 * 2 * 12 + 40 + 0.7 * 32);
    return {{"ms", ms},
            {"triad_gb_per_s", triad},
            {"compulsory_mb", bytes / 1e6},
            {"compulsory_ms", bytes / 1e6 / triad}};
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("The plain loops that a build is measured against.");
    std::string scene = "builtin:figure?triangles=1000000";
    int threads = 2;
    app.add_option("--scene", scene, "Scene")->capture_default_str();
    app.add_option("--threads", threads, "Threads")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        fmt::print("{}\n", run(scene, threads).dump());
    } catch (const std::exception& error) {
        fmt::print(stderr, "build_floor: {}\n", error.what());
        return 1;
    }
    return 0;
}
