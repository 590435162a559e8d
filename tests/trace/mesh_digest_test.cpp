// Any and all hits of float meshes, and all kinds of hits of meshes in double, against digests kept
// here. digest_test.cpp has the closest hits of float meshes, and the trees.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/kdtree.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <fmt/format.h>

#include <memory>
#include <string>

#include "support/cwbvh_trace.h"
#include "support/digest_inputs.h"
#include "support/digests.h"
#include "support/double_scenes.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t mesh_digest_seed = 12;
constexpr std::size_t ray_count = 1500, rays_to_hits = 150;

template <class Hits>
Answer closest_answer(const Hits& hits) {
    Answer out;
    for (const auto& hit : hits) {
        out.values.add_hit(hit);
        out.found += hit.hit();
    }
    return out;
}

Answer any_answer(const std::vector<std::uint8_t>& occluded) {
    Answer out;
    out.values.add_all(occluded);
    for (const std::uint8_t hit : occluded) out.found += hit;
    return out;
}

template <class All>
Answer all_answer(const All& all) {
    Answer out = closest_answer(all.hits);
    out.where.add_all(all.offsets);
    return out;
}

template <class Hits>
Answer any_of_closest(const Hits& hits) {
    std::vector<std::uint8_t> occluded;
    for (const auto& hit : hits) occluded.push_back(hit.hit());
    return any_answer(occluded);
}

template <class Tree, class AnyRay>
Answer any_one_by_one(const Tree& tree, const std::vector<AnyRay>& rays) {
    std::vector<std::uint8_t> occluded;
    for (const AnyRay& ray : rays) occluded.push_back(any_hit(tree, ray));
    return any_answer(occluded);
}

/// Any tree that trace_any takes.
template <class Tree, class AnyRay>
Answer any(const Tree& tree, const std::vector<AnyRay>& rays, const TraceOptions& options = {}) {
    std::vector<std::uint8_t> occluded(rays.size());
    trace_any(tree, rays, occluded, options);
    return any_answer(occluded);
}

Answer any(const KdTree& tree, const std::vector<Ray>& rays, const TraceOptions& options) {
    std::vector<std::uint8_t> occluded(rays.size());
    kd_trace_any(tree, rays, occluded, options);
    return any_answer(occluded);
}

MeshD mesh_named(const std::string& name) {
    if (name == "atrium") return in_double(small_builtin("builtin:atrium?triangles=10000"));
    if (name == "grove") return in_double(small_builtin("builtin:grove?triangles=10000"));
    if (name == "lattice") return in_double(lattice_mesh(400, 4, mesh_digest_seed));
    if (name == "far figure")
        return in_double(small_builtin("builtin:figure?triangles=10000"), 1.0 / 3.0, utm_place);
    if (name == "far slivers") return slivers_d(1000, mesh_digest_seed);
    return random_soup_d(1000, mesh_digest_seed, 0.3);
}

/// A float mesh, its rays, and trees of every kind that may be asked.
struct FloatTrees {
    struct Wide {
        std::string name;
        WideBvh tree;
    };
    Mesh mesh;
    std::vector<Ray> rays;
    std::vector<std::pair<Builder, Bvh>> binary;
    std::vector<Wide> wide;
    KdTree kd;
    std::unique_ptr<Cwbvh> compressed;

    explicit FloatTrees(const MeshD& wide_mesh) : mesh(in_float(wide_mesh)) {
        rays = in_float(digest_rays(wide_mesh, ray_count, mesh_digest_seed));
        for (const Builder builder :
             {Builder::karras, Builder::ploc, Builder::binned, Builder::split, Builder::sbvh})
            binary.emplace_back(builder, build_bvh(mesh, {.builder = builder}));
        add_rays_to_hits(rays, trace(binary[0].second, rays), rays_to_hits);
        for (const int width : {4, 8})
            for (const bool compact : {false, true})
                wide.push_back({fmt::format("wide {}{}", width, compact ? " compact" : ""),
                                WideBvh(binary[1].second, {.width = width, .compact = compact})});
        wide.push_back({"wide of sbvh", WideBvh(binary.back().second)});
        wide.push_back({"wide of the mesh", build_wide_bvh(mesh)});
        kd = build_kdtree(mesh);
        compressed = std::make_unique<Cwbvh>(binary[1].second);
    }
};

std::vector<TraceOptions> one_and_two_threads() { return {{.threads = 1}, {.threads = 2}}; }

Question float_question(const std::string& name, const std::string& query) {
    const auto trees = std::make_shared<FloatTrees>(mesh_named(name));
    Question question{Packed().add(trees->mesh).add_all(trees->rays), ray_count / 5, {}};
    const bool all = query == "all";
    const auto add = [&](std::string way, auto&& answer) {
        question.ways.push_back({std::move(way), answer});
    };
    for (const TraceOptions& options : one_and_two_threads()) {
        for (const auto& [builder, tree] : trees->binary)
            add(fmt::format("{}, {} threads", builder_name(builder), options.threads),
                [=, tree = &tree] {
                    return all ? all_answer(trace_all(*tree, trees->rays, options))
                               : any(*tree, trees->rays, options);
                });
        for (const std::string& isa : simd_instruction_sets())
            for (const FloatTrees::Wide& wide : trees->wide) {
                TraceOptions with_isa = options;
                with_isa.isa = isa;
                for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                            SimdPath::stream, SimdPath::sorted}) {
                    with_isa.path = path;
                    add(fmt::format("{}, {}, {}, {} threads", wide.name, isa, simd_path_name(path),
                                    options.threads),
                        [=, tree = &wide.tree] {
                            return all ? all_answer(trace_all(*tree, trees->rays, with_isa))
                                       : any(*tree, trees->rays, with_isa);
                        });
                    if (all) break;  // has one path
                }
            }
        if (all) continue;
        add("k-d tree", [=] { return any(trees->kd, trees->rays, options); });
        add("cwbvh", [=] { return any(*trees->compressed, trees->rays, options); });
    }
    if (all) return question;
    add("one by one", [=] { return any_one_by_one(trees->binary[1].second, trees->rays); });
    add("one by one, wide", [=] { return any_one_by_one(trees->wide[0].tree, trees->rays); });
    add("closest", [=] { return any_of_closest(trace(trees->wide[0].tree, trees->rays)); });
    add("closest in the k-d tree",
        [=] { return any_of_closest(kd_trace(trees->kd, trees->rays)); });
    return question;
}

struct DoubleTrees {
    MeshD mesh;
    std::vector<RayD> rays;
    std::vector<std::pair<Builder, BvhD>> trees;

    explicit DoubleTrees(MeshD of) : mesh(std::move(of)) {
        rays = digest_rays(mesh, ray_count, mesh_digest_seed);
        for (const Builder builder :
             {Builder::karras, Builder::ploc, Builder::binned, Builder::split, Builder::sbvh})
            trees.emplace_back(builder, build_bvh(mesh, {.builder = builder}));
        add_rays_to_hits(rays, trace(trees[0].second, rays), rays_to_hits);
    }

    [[nodiscard]] Answer ask(const BvhD& tree, const std::string& query,
                             const TraceOptions& options) const {
        if (query == "all") return all_answer(trace_all(tree, rays, options));
        if (query == "any") return any(tree, rays, options);
        return closest_answer(trace(tree, rays, options));
    }
    [[nodiscard]] Answer closest_one_by_one() const {
        std::vector<HitD> hits;
        for (const RayD& ray : rays) hits.push_back(closest_hit(trees[1].second, ray));
        return closest_answer(hits);
    }
    [[nodiscard]] std::vector<HitD> brute_force() const { return trace_brute_force(mesh, rays); }
};

Question double_question(const std::string& name, const std::string& query) {
    const auto trees = std::make_shared<DoubleTrees>(mesh_named(name));
    Question question{Packed().add(trees->mesh).add_all(trees->rays), ray_count / 5, {}};
    for (const TraceOptions& options : one_and_two_threads())
        for (const auto& [builder, tree] : trees->trees)
            question.ways.push_back(
                {fmt::format("{}, {} threads", builder_name(builder), options.threads),
                 [=, tree = &tree] { return trees->ask(*tree, query, options); }});
    if (query == "all") return question;
    const bool any = query == "any";
    question.ways.push_back({"one by one", [=] {
                                 return any ? any_one_by_one(trees->trees[1].second, trees->rays)
                                            : trees->closest_one_by_one();
                             }});
    question.ways.push_back({"each triangle", [=] {
                                 const std::vector<HitD> hits = trees->brute_force();
                                 return any ? any_of_closest(hits) : closest_answer(hits);
                             }});
    return question;
}

Question ask(const std::string& scene, const std::string& query) {
    const std::string mesh = scene.substr(scene.find(' ') + 1);
    return scene.starts_with("float") ? float_question(mesh, query) : double_question(mesh, query);
}

constexpr Known known[] = {
    {"float atrium", "any", "4bd6373aa326241b", "ae08b1a663ce5d8d", "-"},
    {"float atrium", "all", "4bd6373aa326241b", "14e479f4abd6edc8", "8549c4616835ef87"},
    {"float grove", "any", "98749649fbe1b07f", "13b299fc78cf20c7", "-"},
    {"float grove", "all", "98749649fbe1b07f", "40bbaf909eca3a08", "2c7f44906533d846"},
    {"float lattice", "any", "c45302b5a3187401", "b070aecff7386bc8", "-"},
    {"float lattice", "all", "c45302b5a3187401", "d0af1c41b9c50b0b", "7c06dffa29e31963"},
    {"double atrium", "closest", "46234d33f08b3aa9", "3ea83b6293b33898", "-"},
    {"double atrium", "any", "46234d33f08b3aa9", "41b667b776906e7b", "-"},
    {"double atrium", "all", "46234d33f08b3aa9", "a323982e37c5c292", "0e9f3dc648b29da6"},
    {"double far figure", "closest", "8b64e0e134d029b1", "7ea7b15f7562f7ef", "-"},
    {"double far figure", "any", "8b64e0e134d029b1", "3ddf01b19f1cfab1", "-"},
    {"double far figure", "all", "8b64e0e134d029b1", "4c21b178e0b6d944", "df11939cc0344efe"},
    {"double far slivers", "closest", "9890294e124ec703", "f639354d50471d51", "-"},
    {"double far slivers", "any", "9890294e124ec703", "ec365db0f824d962", "-"},
    {"double far slivers", "all", "9890294e124ec703", "8571a1cfa979a9ba", "fe0aa7d8c5de4d9a"},
    {"double lattice", "closest", "956d85a419e8d53f", "04d8631b1898cd89", "-"},
    {"double lattice", "any", "956d85a419e8d53f", "9a48d4ae7de1c99e", "-"},
    {"double lattice", "all", "956d85a419e8d53f", "039089545ecbbccf", "eaa34a36b5fdb48a"},
    {"double soup", "closest", "06348298fa34adc4", "92ef2367753801d2", "-"},
    {"double soup", "any", "06348298fa34adc4", "68e4b9e1d3fd12cc", "-"},
    {"double soup", "all", "06348298fa34adc4", "5e9316730cf4f655", "b0096557725dadb2"},
};

class MeshDigest : public testing::TestWithParam<Known> {};

TEST_P(MeshDigest, IsKnown) { expect_known(GetParam(), ask(GetParam().scene, GetParam().query)); }

INSTANTIATE_TEST_SUITE_P(Meshes, MeshDigest, testing::ValuesIn(known),
                         [](const auto& row) { return name_of(row.param); });

}  // namespace
}  // namespace raydix::test
