// How fast are builds on a GPU, stage by stage, and what part of the memory's rate do hierarchy and
// boxes reach? How fast are rays through a compressed wide tree? Every tree is first compared with
// the host's. A JSON line per scene and tree on standard output; scripts/gpu keeps them. Without a
// device: exit code 1 and the reason.
#include <fmt/format.h>
#include <raydix/check.h>
#include <raydix/device_cwbvh.h>
#include <raydix/device_trees.h>
#include <raydix/machine.h>
#include <raydix/model.h>
#include <raydix/rays.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace {

using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> scenes{
        "builtin:figure?triangles=174000", "builtin:figure?triangles=1000000",
        "builtin:figure?triangles=1770000", "builtin:figure?triangles=10000000"};
    std::vector<std::string> builders{"karras", "lauterbach", "garanzha", "apetrei", "hploc"};
    std::vector<std::string> trees{"bvh", "kdtree", "octree"};
    std::vector<int> bits{30, 63}, max_leaf{1, 4};
    int repeat = 20;
    std::uint64_t seed = 1;
    std::size_t copy_bytes = std::size_t{1} << 30;
};

struct Stage {
    const char* name;
    double raydix::BuildMs::*ms;
};
constexpr Stage stages[] = {
    {"bounds", &raydix::BuildMs::bounds},       {"codes", &raydix::BuildMs::codes},
    {"sort", &raydix::BuildMs::sort},           {"layout", &raydix::BuildMs::layout},
    {"hierarchy", &raydix::BuildMs::hierarchy}, {"fit", &raydix::BuildMs::fit},
    {"total", &raydix::BuildMs::total}};

Json spread_json(std::vector<double> values) {
    std::ranges::sort(values);
    return {{"median", values[values.size() / 2]}, {"min", values.front()}, {"max", values.back()}};
}

/// The mesh in device memory.
struct DeviceInput {
    raydix::DeviceBuffer<raydix::Vec3> vertices;
    raydix::DeviceBuffer<raydix::Triangle> triangles;
    raydix::DeviceMesh mesh;

    explicit DeviceInput(const raydix::Mesh& host)
        : vertices(std::span<const raydix::Vec3>(host.vertices)),
          triangles(std::span<const raydix::Triangle>(host.triangles)),
          mesh{vertices.data(), static_cast<std::uint32_t>(vertices.size()), triangles.data(),
               static_cast<std::uint32_t>(triangles.size())} {
        if (host.triangles.empty()) throw std::runtime_error("the scene has no triangles");
    }
};

/// Milliseconds of each stage over all runs.
Json stages_json(const std::vector<raydix::BuildMs>& runs) {
    Json ms;
    for (const Stage& stage : stages) {
        std::vector<double> values;
        for (const raydix::BuildMs& run : runs) values.push_back(run.*stage.ms);
        ms[stage.name] = spread_json(values);
    }
    return ms;
}

template <class Tree>
Json time_builds(Tree& tree, const DeviceInput& input, int repeat) {
    std::vector<raydix::BuildMs> runs;
    for (int i = 0; i < repeat; ++i) runs.push_back(tree.build_timed(input.mesh));
    Json ms = stages_json(runs);
    const double total = 1e-3 * ms["total"]["median"].get<double>();
    return {{"same_tree_as_cpu", true},
            {"repeat", repeat},
            {"ms", ms},
            {"gprims_per_s", input.mesh.triangle_count / total / 1e9},
            {"device_bytes", tree.bytes()}};
}

Json measure(const DeviceInput& input, const raydix::BuildOptions& options, int repeat,
             double copy_rate, const raydix::Bvh& expected) {
    const std::uint32_t n = input.mesh.triangle_count;
    raydix::DeviceBvh tree(raydix::PrimitiveKind::triangles, n, options);
    tree.build(input.mesh);
    if (const auto report = check_same(tree.download(), expected); !report.ok)
        throw std::runtime_error("the device's tree differs from the host's: " + report.broken);
    Json row{{"tree", "bvh"},
             {"builder", builder_name(options.builder)},
             {"bits", options.bits},
             {"max_leaf", options.max_leaf}};
    row.update(time_builds(tree, input, repeat));
    // What hierarchy and boxes cannot do without: a key and a box of each primitive read once, the
    // nodes written once.
    const std::uint64_t key_bytes = options.bits == 30 ? 4 : 8;
    const std::uint64_t bytes =
        expected.order().size() * (key_bytes + 24) + expected.nodes().size_bytes();
    const Json& ms = row["ms"];
    const double seconds =
        1e-3 * (ms["hierarchy"]["median"].get<double>() + ms["fit"]["median"].get<double>());
    row["compulsory_bytes"] = bytes;
    row["of_copy_rate"] = static_cast<double>(bytes) / seconds / copy_rate;
    row["sah"] = raydix::tree_stats(expected).sah.value_or(0);
    return row;
}

Json measure_kdtree(const DeviceInput& input, const raydix::Mesh& mesh,
                    const raydix::KdTreeOptions& options, int repeat) {
    raydix::DeviceKdTree tree(raydix::PrimitiveKind::triangles, input.mesh.triangle_count, options);
    tree.build(input.mesh);
    if (kd_hash(tree.download()) != kd_hash(build_kdtree(mesh, options)))
        throw std::runtime_error("the device's k-d tree differs from the host's");
    Json row{{"tree", "kdtree"}, {"bits", options.bits}, {"max_leaf", options.max_leaf}};
    row.update(time_builds(tree, input, repeat));
    return row;
}

Json measure_octree(const DeviceInput& input, const raydix::Mesh& mesh,
                    const raydix::OctreeOptions& options, int repeat) {
    const raydix::Octree expected = build_octree(mesh, options);
    raydix::DeviceOctree tree(raydix::PrimitiveKind::triangles, input.mesh.triangle_count, options,
                              static_cast<std::uint32_t>(expected.nodes().size()));
    tree.build(input.mesh);
    if (tree_hash(tree.download()) != tree_hash(expected))
        throw std::runtime_error("the device's octree differs from the host's");
    Json row{{"tree", "octree"},
             {"bits", options.bits},
             {"max_leaf", options.max_leaf},
             {"nodes", expected.nodes().size()}};
    row.update(time_builds(tree, input, repeat));
    return row;
}

template <class Print>
void run_builders(const Options& options, const DeviceInput& input, const raydix::Mesh& mesh,
                  int bits, int max_leaf, double copy_rate, const Print& print) {
    raydix::BuildOptions build;
    build.bits = bits;
    build.max_leaf = max_leaf;
    const raydix::Bvh lbvh = build_bvh(mesh, build);
    for (const std::string& builder : options.builders) {
        build.builder = raydix::builder_from_name(builder);
        if (build.builder == raydix::Builder::hploc)
            print(measure(input, build, options.repeat, copy_rate, build_bvh(mesh, build)));
        else
            print(measure(input, build, options.repeat, copy_rate, lbvh));
    }
}

/// Rays through the compressed wide tree, by both kernels; hits are first compared with the CPU's.
Json measure_rays(const raydix::DeviceCwbvhTree& tree, const std::vector<raydix::Ray>& rays,
                  const std::vector<raydix::Hit>& wanted, int repeat) {
    const auto n = static_cast<std::uint32_t>(rays.size());
    const raydix::DeviceBuffer<raydix::Ray> input{std::span(rays)};
    raydix::DeviceBuffer<raydix::TreeHit> output(n);
    raydix::DeviceBuffer<std::byte> scratch(256);
    const std::span<std::byte> lent(scratch.data(), scratch.size());
    Json rates{{"count", n}};
    for (const auto& [name, kernel] :
         {std::pair("cwbvh", raydix::CwbvhKernel::cwbvh),
          std::pair("persistent_cwbvh", raydix::CwbvhKernel::persistent_cwbvh)}) {
        std::vector<raydix::TreeHit> hits(n);
        trace_on_device(tree, input.data(), n, output.data(), kernel, lent, nullptr);
        output.download(hits);
        if (!std::ranges::equal(hits, wanted, [](const auto& a, const auto& b) {
                return std::memcmp(&a, &b, sizeof(raydix::TreeHit)) == 0;
            }))
            throw std::runtime_error(std::string(name) + " finds other hits than the CPU");
        std::vector<double> mrays;
        for (int i = 0; i < repeat; ++i)
            mrays.push_back(
                1e-3 * n /
                time_trace_on_device(tree, input.data(), n, output.data(), kernel, lent, nullptr));
        rates[name] = {{"mrays_per_s", spread_json(mrays)}};
    }
    return rates;
}

Json measure_cwbvh(const raydix::Model& scene, int repeat) {
    const raydix::Bvh bvh =
        build_bvh(scene.mesh(), {.builder = raydix::Builder::ploc, .max_leaf = 1});
    const raydix::Cwbvh tree(bvh);
    const raydix::DeviceCwbvh device(tree);
    std::vector<std::uint32_t> pixels;
    const auto primary = make_primary_rays(scene.cameras.cameras.at(0), 1024, 768, &pixels);
    const auto hits = trace(bvh, primary);
    raydix::SecondaryOptions secondary{.kind = raydix::RayKind::diffuse, .samples = 8};
    const auto diffuse = make_secondary_rays(bvh, primary, hits, pixels, secondary);
    return {{"builder", "ploc"},
            {"bytes_per_triangle", tree.stats().bytes_per_triangle},
            {"same_hits_as_cpu", true},
            {"repeat", repeat},
            {"primary", measure_rays(device.tree(), primary, hits, repeat)},
            {"diffuse", measure_rays(device.tree(), diffuse, trace(bvh, diffuse), repeat)}};
}

void run(const Options& options) {
    const std::string device = raydix::device_name();
    const double copy_rate = raydix::measure_device_copy(options.copy_bytes, options.repeat);
    for (const std::string& name : options.scenes) {
        const raydix::Model scene = raydix::load_flat_model(name, options.seed);
        const DeviceInput input(scene.mesh());
        const auto print = [&](const Json& row) {
            Json line{{"bench", "gpu_build"},
                      {"device", device},
                      {"cpu", raydix::machine_info().cpu},
                      {"compiler", __VERSION__},
                      {"copy_bytes_per_s", copy_rate},
                      {"scene", name},
                      {"seed", options.seed},
                      {"triangles", scene.mesh().triangles.size()}};
            line.update(row);
            fmt::print("{}\n", line.dump());
        };
        Json rays{{"bench", "gpu_cwbvh"},
                  {"device", device},
                  {"scene", name},
                  {"seed", options.seed},
                  {"triangles", scene.mesh().triangles.size()}};
        rays.update(measure_cwbvh(scene, options.repeat));
        fmt::print("{}\n", rays.dump());
        for (const int bits : options.bits)
            for (const int max_leaf : options.max_leaf)
                for (const std::string& tree : options.trees) {
                    if (tree == "kdtree")
                        print(measure_kdtree(input, scene.mesh(),
                                             {.bits = bits, .max_leaf = max_leaf}, options.repeat));
                    else if (tree == "octree")
                        print(measure_octree(input, scene.mesh(),
                                             {.bits = bits, .max_leaf = max_leaf}, options.repeat));
                    else
                        run_builders(options, input, scene.mesh(), bits, max_leaf, copy_rate,
                                     print);
                }
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Builds on a GPU: milliseconds per stage, rate, part of the memory's copy rate");
    Options options;
    app.add_option("--scene", options.scenes, "Scenes of triangles")->capture_default_str();
    app.add_option("--tree", options.trees, "Kinds of tree")
        ->check(CLI::IsMember({"bvh", "kdtree", "octree"}))
        ->capture_default_str();
    app.add_option("--builder", options.builders, "Builders of a bvh")->capture_default_str();
    app.add_option("--bits", options.bits, "Bits of the Morton codes")->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "Most primitives in a leaf")
        ->capture_default_str();
    app.add_option("--repeat", options.repeat, "Timed builds of each kind")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app.add_option("--seed", options.seed, "Seed of built-in scenes")->capture_default_str();
    app.add_option("--copy-bytes", options.copy_bytes, "Size of the copy that measures the memory")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_gpu: {}\n", error.what());
        return 1;
    }
    return 0;
}
