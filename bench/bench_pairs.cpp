// How fast are the pairs of triangles of one mesh that meet? Ours beside CGAL's box intersection
// (Zomorodian and Edelsbrunner 2002) with the same test of two triangles, in one run, in turns
// (A B A B). Answers are compared first. Wall-clock and processor time, one JSON line.
#include <CGAL/Box_intersection_d/Box_with_info_d.h>
#include <CGAL/box_intersection_d.h>
#include <fmt/format.h>
#include <raydix/machine.h>
#include <raydix/pairs.h>
#include <raydix/raydix.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <functional>
#include <nlohmann/json.hpp>

#include "primitives/exact_overlap.h"
#include "work_times.h"

namespace {

using namespace raydix;
using bench::spread_json;
using bench::time_of;
using bench::Times;
using Json = nlohmann::ordered_json;
using CgalBox = CGAL::Box_intersection_d::Box_with_info_d<float, 3, std::uint32_t>;

struct Options {
    std::string scene = "builtin:figure?triangles=1000000", builder = "apetrei";
    int threads = 2, repeat = 3, max_leaf = 4;
    std::vector<int> cutoffs{10, 100, 1000};
    bool broad = false;
};

LeafTriangle corners(const Mesh& mesh, std::uint32_t i) {
    const Triangle& t = mesh.triangles[i];
    return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

/// Boxes, the intersection through pointers to them as CGAL's manual advises, and the order.
std::vector<PrimitivePair> cgal_pairs(const Mesh& mesh, bool narrow, int cutoff) {
    std::vector<CgalBox> boxes;
    boxes.reserve(mesh.triangles.size());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const LeafTriangle t = corners(mesh, i);
        Aabb box = box_of(t.v0, t.v1, t.v2);
        boxes.emplace_back(&box.lo.x, &box.hi.x, i);
    }
    std::vector<const CgalBox*> pointers;
    pointers.reserve(boxes.size());
    for (const CgalBox& box : boxes) pointers.push_back(&box);
    std::vector<PrimitivePair> pairs;
    CGAL::box_self_intersection_d(
        pointers.begin(), pointers.end(),
        [&](const CgalBox* a, const CgalBox* b) {
            const std::uint32_t i = std::min(a->info(), b->info()),
                                j = std::max(a->info(), b->info());
            const LeafTriangle s = corners(mesh, i), t = corners(mesh, j);
            if (!share_a_corner(s, t) && (!narrow || triangles_touch(s, t)))
                pairs.push_back({i, j});
        },
        std::ptrdiff_t{cutoff}, CGAL::Box_intersection_d::CLOSED);
    std::sort(pairs.begin(), pairs.end(), [](const PrimitivePair& x, const PrimitivePair& y) {
        return x.first != y.first ? x.first < y.first : x.second < y.second;
    });
    return pairs;
}

void run(const Options& options) {
    const Mesh mesh = load_flat_model(options.scene).mesh();
    const BuildOptions build{.builder = builder_from_name(options.builder),
                             .max_leaf = options.max_leaf,
                             .threads = options.threads};
    const PairOptions pair_options{.narrow = !options.broad, .threads = options.threads};
    std::vector<PrimitivePair> ours, theirs;
    Bvh bvh = build_bvh(mesh, build);
    // The best cutoff is CGAL's.
    int best_cutoff = options.cutoffs.front();
    double least = 1e300;
    for (const int cutoff : options.cutoffs) {
        const Times t = time_of([&] { theirs = cgal_pairs(mesh, !options.broad, cutoff); });
        if (t.cpu < least) {
            least = t.cpu;
            best_cutoff = cutoff;
        }
    }
    ours = overlapping_pairs(bvh, pair_options);
    if (ours != theirs)
        throw InputError(fmt::format("{} pairs, but CGAL finds {}", ours.size(), theirs.size()));
    std::vector<Times> of_build, of_pairs, of_cgal;
    for (int i = 0; i < options.repeat; ++i) {
        of_build.push_back(time_of([&] { bvh = build_bvh(mesh, build); }));
        of_pairs.push_back(time_of([&] { ours = overlapping_pairs(bvh, pair_options); }));
        of_cgal.push_back(time_of([&] { theirs = cgal_pairs(mesh, !options.broad, best_cutoff); }));
    }
    Json line{{"bench", "pairs"},
              {"cpu", machine_info().cpu},
              {"scene", options.scene},
              {"narrow", !options.broad},
              {"triangles", mesh.triangles.size()},
              {"pairs", ours.size()},
              {"builder", options.builder},
              {"max_leaf", options.max_leaf},
              {"threads", options.threads},
              {"repeat", options.repeat},
              {"cgal_cutoff", best_cutoff}};
    const auto put = [&](const char* name, const std::vector<Times>& times) {
        line[name] = {{"wall_ms", spread_json(times, &Times::wall)},
                      {"cpu_ms", spread_json(times, &Times::cpu)}};
    };
    put("build", of_build);
    put("pairs_of_tree", of_pairs);
    put("cgal", of_cgal);
    fmt::print("{}\n", line.dump());
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Pairs of triangles of one mesh, beside CGAL's"};
    Options options;
    app.add_option("--scene", options.scene, "a mesh")->capture_default_str();
    app.add_option("--builder", options.builder, "of the tree")->capture_default_str();
    app.add_option("--max-leaf", options.max_leaf, "primitives in a leaf")->capture_default_str();
    app.add_option("--threads", options.threads, "ours; CGAL has one")->capture_default_str();
    app.add_option("--repeat", options.repeat, "turns after the comparison")->capture_default_str();
    app.add_option("--cutoff", options.cutoffs, "tried for CGAL; the best is measured");
    app.add_flag("--broad", options.broad, "boxes only");
    CLI11_PARSE(app, argc, argv);
    try {
        run(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_pairs: {}\n", error.what());
        return 1;
    }
    return 0;
}
