// Hits of instances, in float and in double, against digests kept here: the same bits for every
// tree, every number of threads and every processor, and those of each instance looked at alone.
#include <gtest/gtest.h>
#include <raydix/instances.h>
#include <raydix/instances_d.h>
#include <raydix/trace.h>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>

#include "instances/affine.h"
#include "instances/affine_double.h"
#include "support/digest_inputs.h"
#include "support/digests.h"
#include "support/double_scenes.h"
#include "support/instance_layouts.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 12;
constexpr std::size_t ray_count = 1000, rays_to_hits = 150;

/// Today's calls in float.
struct FloatCalls {
    using Tree = Bvh;
    using Scene = InstancedScene;
    using SceneHit = InstanceHit;
    using AnyRay = Ray;
    using Inverse = Affine;

    static std::vector<Tree> trees(const Layout& layout, Builder builder) {
        std::vector<Tree> trees;
        for (const MeshD& mesh : layout.meshes)
            trees.push_back(build_bvh(in_float(mesh), {.builder = builder}));
        return trees;
    }
    static Instance instance(std::uint32_t object, const Placed& placed) {
        Instance out{object, {}, placed.mask};
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 4; ++j)
                out.transform.m[i][j] = static_cast<float>(placed.rows[i][j]);
        return out;
    }
    static std::vector<Ray> rays(const std::vector<RayD>& rays) { return in_float(rays); }
    /// The ray as it enters, by each level's inverse in turn.
    static Ray inside(const Ray& ray, const std::vector<Inverse>& inverses) {
        WideRayLine line{Double3(ray.origin), Double3(ray.direction)};
        for (const Inverse& inverse : inverses) line = line.into(inverse);
        return line.rounded(ray.tmin, ray.tmax);
    }
};

/// Today's calls in double.
struct DoubleCalls {
    using Tree = BvhD;
    using Scene = InstancedSceneD;
    using SceneHit = InstanceHitD;
    using AnyRay = RayD;
    using Inverse = InverseD;

    static std::vector<Tree> trees(const Layout& layout, Builder builder) {
        std::vector<Tree> trees;
        for (const MeshD& mesh : layout.meshes)
            trees.push_back(build_bvh(mesh, {.builder = builder}));
        return trees;
    }
    static InstanceD instance(std::uint32_t object, const Placed& placed) {
        return {object, {placed.rows}, placed.mask};
    }
    static std::vector<RayD> rays(const std::vector<RayD>& rays) { return rays; }
    static RayD inside(const RayD& ray, const std::vector<Inverse>& inverses) {
        LineD line(ray);
        for (const Inverse& inverse : inverses) line = line.into(inverse);
        return line.ray(ray.tmin, ray.tmax);
    }
};

/// A scene of a layout over trees of its meshes, of whatever kind the scene takes.
template <class Calls, class Tree = typename Calls::Tree>
class Built {
public:
    Built(const Layout& layout, std::vector<Tree> trees) : trees_(std::move(trees)) {
        std::vector<std::uint32_t> meshes, groups{Calls::Scene::scene};
        for (const Tree& tree : trees_) meshes.push_back(scene.add_object(tree));
        while (groups.size() < layout.groups.size()) groups.push_back(scene.add_group());
        for (std::size_t g = 0; g < groups.size(); ++g)
            for (const Placed& placed : layout.groups[g])
                scene.add_instance(
                    groups[g],
                    Calls::instance((placed.group ? groups : meshes)[placed.what], placed));
        scene.build();
    }

    typename Calls::Scene scene;

private:
    std::vector<Tree> trees_;
};

/// Rays with their masks through a layout, and what became of them in terms of any API: t, prim, u,
/// v, geometry and instance. A mesh is geometry 0 of what an instance shows.
template <class Calls>
class Traced {
public:
    using AnyRay = typename Calls::AnyRay;
    using SceneHit = typename Calls::SceneHit;
    using Hits = std::vector<SceneHit>;
    using Path = decltype(SceneHit::path);

    explicit Traced(const std::string& name) : layout_(layout_named(name)) {
        for (ShownMesh& shown : shown_meshes(layout_)) {
            Path path = InstanceHit::unused();
            std::copy(shown.path.begin(), shown.path.end(), path.begin());
            numbers_[path] = shown.number;
            Alone alone{std::move(shown), path, {}};
            for (const Placed* placed : alone.shown.way)
                alone.inverses.push_back(
                    *inverse_of(affine_of(Calls::instance(0, *placed).transform)));
            alone_.push_back(std::move(alone));
        }
        rays_ = Calls::rays(digest_rays(some_triangles(layout_, 20), ray_count, seed));
        see_by_masks();
        const auto built = scene(Builder::karras);
        std::vector<decltype(SceneHit::hit)> hits;
        for (const SceneHit& hit : trace(built->scene, rays_, {.masks = masks_}))
            hits.push_back(hit.hit);
        add_rays_to_hits(rays_, hits, rays_to_hits);
        see_by_masks();
    }

    [[nodiscard]] Packed input() const {
        Packed packed;
        packed.add_all(layout_.meshes);
        for (const Alone& alone : alone_)
            for (const Placed* placed : alone.shown.way) {
                for (const auto& row : placed->rows) packed.add_all(row);
                packed.add(placed->mask);
            }
        return packed.add_all(rays_).add_all(masks_);
    }
    [[nodiscard]] const Layout& layout() const { return layout_; }
    [[nodiscard]] std::size_t rays() const { return rays_.size(); }
    [[nodiscard]] std::shared_ptr<Built<Calls>> scene(Builder builder) const {
        return std::make_shared<Built<Calls>>(layout_, Calls::trees(layout_, builder));
    }

    template <class Scene>
    [[nodiscard]] Answer closest(const Scene& scene, int threads) const {
        return answer(trace(scene, rays_, {.masks = masks_, .threads = threads}));
    }
    template <class Scene>
    [[nodiscard]] Answer closest_one_by_one(const Scene& scene) const {
        Hits hits;
        for (std::size_t i = 0; i < rays_.size(); ++i)
            hits.push_back(closest_hit(scene, rays_[i], masks_[i]));
        return answer(hits);
    }
    /// Of calls with one mask for all their rays.
    template <class Scene>
    [[nodiscard]] Answer closest_by_mask(const Scene& scene) const {
        Hits hits(rays_.size());
        std::map<std::uint32_t, std::vector<std::size_t>> places;
        for (std::size_t i = 0; i < rays_.size(); ++i) places[masks_[i]].push_back(i);
        for (const auto& [mask, of_mask] : places) {
            std::vector<AnyRay> rays;
            for (const std::size_t i : of_mask) rays.push_back(rays_[i]);
            const Hits found = trace(scene, rays, {.mask = mask});
            for (std::size_t k = 0; k < found.size(); ++k) hits[of_mask[k]] = found[k];
        }
        return answer(hits);
    }
    [[nodiscard]] Hits closest_of_each_alone() const {
        const auto trees = Calls::trees(layout_, Builder::karras);
        Hits hits;
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            SceneHit best;
            for (const Alone& alone : alone_) {
                if (!alone.seen_by(masks_[i])) continue;
                const auto hit =
                    closest_hit(trees[alone.shown.mesh], Calls::inside(rays_[i], alone.inverses));
                if (!hit.hit()) continue;
                const bool nearer = !best.hit.hit() || hit.t < best.hit.t;
                if (nearer || (hit.t == best.hit.t && alone.path < best.path))
                    best = {hit, 0, alone.path};
            }
            hits.push_back(best);
        }
        return hits;
    }
    template <class Scene>
    [[nodiscard]] Answer any(const Scene& scene, int threads) const {
        std::vector<std::uint8_t> occluded(rays_.size());
        trace_any(scene, rays_, occluded, {.masks = masks_, .threads = threads});
        return answer_any(occluded);
    }

    [[nodiscard]] Answer answer(const Hits& hits) const {
        Answer out;
        for (const SceneHit& hit : hits) {
            out.values.add_hit(hit.hit);
            const std::uint32_t geometry = hit.hit.hit() ? 0 : no_primitive,
                                instance = hit.hit.hit() ? numbers_.at(hit.path) : no_primitive;
            out.where.add(geometry).add(instance);
            out.found += hit.hit.hit();
        }
        return out;
    }
    [[nodiscard]] static Answer answer_any(const std::vector<std::uint8_t>& occluded) {
        Answer out;
        out.values.add_all(occluded);
        for (const std::uint8_t hit : occluded) out.found += hit;
        return out;
    }

private:
    struct Alone {
        ShownMesh shown;
        Path path;
        std::vector<typename Calls::Inverse> inverses;

        [[nodiscard]] bool seen_by(std::uint32_t mask) const {
            for (const Placed* placed : shown.way)
                if ((placed->mask & mask) == 0) return false;
            return true;
        }
    };

    void see_by_masks() {
        masks_.clear();
        for (std::size_t i = 0; i < rays_.size(); ++i)
            masks_.push_back(layout_.ray_masks && i % 4 != 0 ? 1u << (i % 5) : 0xFFFFFFFFu);
    }

    Layout layout_;
    std::vector<Alone> alone_;
    std::map<Path, std::uint32_t> numbers_;
    std::vector<AnyRay> rays_;
    std::vector<std::uint32_t> masks_;
};

template <class Calls>
Question closest_question(std::shared_ptr<Traced<Calls>> traced) {
    Question question{traced->input(), traced->rays() / 5, {}};
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::sbvh}) {
        const auto built = traced->scene(builder);
        for (const int threads : {1, 2})
            question.ways.push_back({fmt::format("{}, {} threads", builder_name(builder), threads),
                                     [=] { return traced->closest(built->scene, threads); }});
    }
    const auto built = traced->scene(Builder::ploc);
    question.ways.push_back(
        {"one by one", [=] { return traced->closest_one_by_one(built->scene); }});
    question.ways.push_back(
        {"a mask a call", [=] { return traced->closest_by_mask(built->scene); }});
    question.ways.push_back(
        {"each alone", [=] { return traced->answer(traced->closest_of_each_alone()); }});
    return question;
}

template <class Calls>
Question any_question(std::shared_ptr<Traced<Calls>> traced) {
    Question question{traced->input(), traced->rays() / 5, {}};
    for (const Builder builder : {Builder::karras, Builder::sbvh}) {
        const auto built = traced->scene(builder);
        for (const int threads : {1, 2})
            question.ways.push_back({fmt::format("{}, {} threads", builder_name(builder), threads),
                                     [=] { return traced->any(built->scene, threads); }});
    }
    question.ways.push_back({"each alone", [=] {
                                 std::vector<std::uint8_t> hit_or_miss;
                                 for (const auto& hit : traced->closest_of_each_alone())
                                     hit_or_miss.push_back(hit.hit.hit());
                                 return traced->answer_any(hit_or_miss);
                             }});
    return question;
}

/// A scene in double shows trees in float too, with the hits of the same corners in double.
void add_float_trees(Question& question, std::shared_ptr<Traced<DoubleCalls>> traced) {
    const auto built = std::make_shared<Built<DoubleCalls, Bvh>>(
        traced->layout(), FloatCalls::trees(traced->layout(), Builder::ploc));
    question.ways.push_back({"trees in float", [=] { return traced->closest(built->scene, 2); }});
}

Question ask(const std::string& scene, const std::string& query) {
    const std::string layout = scene.substr(scene.find(' ') + 1);
    const bool closest = query == "closest";
    if (scene.starts_with("float")) {
        const auto traced = std::make_shared<Traced<FloatCalls>>(layout);
        return closest ? closest_question(traced) : any_question(traced);
    }
    const auto traced = std::make_shared<Traced<DoubleCalls>>(layout);
    if (!closest) return any_question(traced);
    Question question = closest_question(traced);
    add_float_trees(question, traced);
    return question;
}

constexpr Known known[] = {
    {"float grid", "closest", "75852305b6c23653", "4c6c85054ff9a83e", "8aaddb01ec0c495d"},
    {"float grid", "any", "75852305b6c23653", "3486fcd64b613a5a", "-"},
    {"float mirrored", "closest", "8268381f06f703e9", "fd0b92b675eafbb4", "d4b35d1dabd31ff0"},
    {"float mirrored", "any", "8268381f06f703e9", "42ea710b12d71ca6", "-"},
    {"float stretched", "closest", "c20584104f31b797", "72db2ee3815aa725", "635818e41f289259"},
    {"float stretched", "any", "c20584104f31b797", "3e45cd837328a017", "-"},
    {"float sheared", "closest", "567750a971a76cd9", "0166b38ff9e848cf", "50eedecded791a6f"},
    {"float sheared", "any", "567750a971a76cd9", "46a57d5bb7130777", "-"},
    {"float ties", "closest", "fbf5e40eed63fee1", "aa9aa2b44b721b78", "05d1eda1095682cc"},
    {"float ties", "any", "fbf5e40eed63fee1", "1b46b74f3dad02e7", "-"},
    {"float nested", "closest", "197cc8d8fcc29689", "8a10a5fa56e03757", "b1e11f71d8ffba5e"},
    {"float nested", "any", "197cc8d8fcc29689", "944b7fcbb9bf82d5", "-"},
    {"float deep", "closest", "127ca8c9c56c3c0d", "2e8e020fb470d899", "2f6a4dbe1b449813"},
    {"float deep", "any", "127ca8c9c56c3c0d", "07385c12ae1bdd70", "-"},
    {"float masks", "closest", "eaacfaaf44d46e00", "0163e05a8251bb21", "6a7cf0e6ecf3d771"},
    {"float masks", "any", "eaacfaaf44d46e00", "a2e6f83ba807eb60", "-"},
    {"float offset", "closest", "cdb32e5e1bf95544", "5985df39f65de503", "50b1f945934cc206"},
    {"float offset", "any", "cdb32e5e1bf95544", "49e2acd248ef7b33", "-"},
    {"double grid", "closest", "499aa8f03ce67169", "84247a682d964f80", "a5665460299bcedd"},
    {"double grid", "any", "499aa8f03ce67169", "10bb7d5949fa6ee2", "-"},
    {"double far", "closest", "531b047cfcfa9d15", "0920312029b00354", "79c86943bfc5a539"},
    {"double far", "any", "531b047cfcfa9d15", "b5d71eb643216d55", "-"},
    {"double mirrored", "closest", "f326f8597051c871", "d0d93900257affcc", "c22302be91b2aaeb"},
    {"double mirrored", "any", "f326f8597051c871", "3dba4b32e587ff9f", "-"},
    {"double stretched", "closest", "1a3804eab087808f", "558d3f81bb6fb585", "4f479d21e003811f"},
    {"double stretched", "any", "1a3804eab087808f", "cdd1a5f06c64ef4d", "-"},
    {"double sheared", "closest", "f6758230c2469960", "ee5262e09a3a2f93", "f0fb19bcc5bf4e10"},
    {"double sheared", "any", "f6758230c2469960", "87ba3b777f89826b", "-"},
    {"double ties", "closest", "8c3861255c26190b", "b88ac3f68df0c0e7", "d6d52d0b62117f7e"},
    {"double ties", "any", "8c3861255c26190b", "03bef1caab50927a", "-"},
    {"double nested", "closest", "7c691536402fbe38", "d4c219d81eb81d34", "422382cb7eda3458"},
    {"double nested", "any", "7c691536402fbe38", "242c4b2bf125c312", "-"},
    {"double deep", "closest", "5b13c1dc78129653", "267d476ddd97ed41", "92338d3e0e0a8ba9"},
    {"double deep", "any", "5b13c1dc78129653", "7e9237a358fb837c", "-"},
    {"double masks", "closest", "7fbcd9a95c5ad09a", "172da56069ad2e82", "cc8d146a7a987072"},
    {"double masks", "any", "7fbcd9a95c5ad09a", "5c39b53f9f615e66", "-"},
    {"double offset", "closest", "7901168de57a5676", "4d6def58b19a2a4c", "e3df6c8bd8065638"},
    {"double offset", "any", "7901168de57a5676", "421f01a4ec4a22bc", "-"},
};

class InstanceDigest : public testing::TestWithParam<Known> {};

TEST_P(InstanceDigest, IsKnown) {
    expect_known(GetParam(), ask(GetParam().scene, GetParam().query));
}

INSTANTIATE_TEST_SUITE_P(Layouts, InstanceDigest, testing::ValuesIn(known),
                         [](const auto& row) { return name_of(row.param); });

}  // namespace
}  // namespace raydix::test
