// Hits of instances, in float and in double, against digests kept here: the same bits for every
// tree, every number of threads and every processor, and those of each instance looked at alone.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "engine/affine_double.h"
#include "support/digest_inputs.h"
#include "support/digests.h"
#include "support/double_scenes.h"
#include "support/instance_layouts.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t instance_digest_seed = 12;
constexpr std::size_t ray_count = 1000, rays_to_hits = 150;

struct InFloat {
    using Tree = Bvh;
    using Scene = raydix::Scene;
    using SceneHit = Hit;
    using AnyRay = Ray;
    using Inverse = Affine;

    static Mesh mesh(const MeshD& mesh) { return in_float(mesh); }
    static Transform transform(const Placed& placed) {
        Transform out;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 4; ++j) out.m[i][j] = static_cast<float>(placed.rows[i][j]);
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

struct InDouble {
    using Tree = BvhD;
    using Scene = SceneD;
    using SceneHit = HitD;
    using AnyRay = RayD;
    using Inverse = InverseD;

    static MeshD mesh(const MeshD& mesh) { return mesh; }
    static TransformD transform(const Placed& placed) { return {placed.rows}; }
    static std::vector<RayD> rays(const std::vector<RayD>& rays) { return rays; }
    static RayD inside(const RayD& ray, const std::vector<Inverse>& inverses) {
        LineD line(ray);
        for (const Inverse& inverse : inverses) line = line.into(inverse);
        return line.ray(ray.tmin, ray.tmax);
    }
};

/// The scene of a layout: each mesh is geometry 0 of a scene of its own, each group a scene.
template <class Kind>
typename Kind::Scene scene_of(const Layout& layout, const SceneOptions& options) {
    using Scene = typename Kind::Scene;
    std::vector<Scene> meshes, groups(layout.groups.size());
    for (const MeshD& mesh : layout.meshes) meshes.emplace_back(Kind::mesh(mesh), options);
    for (std::size_t g = groups.size(); g-- > 0;) {
        for (const Placed& placed : layout.groups[g])
            groups[g].add((placed.group ? groups : meshes)[placed.what], Kind::transform(placed),
                          {.mask = placed.mask, .id = {}});
        groups[g].commit(options);
    }
    return std::move(groups[0]);
}

/// Rays with their masks through a layout, and what became of them: t, prim, u, v, geometry and
/// instance.
template <class Kind>
class Traced {
public:
    using AnyRay = typename Kind::AnyRay;
    using Scene = typename Kind::Scene;
    using Hits = std::vector<typename Kind::SceneHit>;

    explicit Traced(const std::string& name) : layout_(layout_named(name)) {
        for (ShownMesh& shown : shown_meshes(layout_)) {
            Alone alone{std::move(shown), {}};
            for (const Placed* placed : alone.shown.way)
                alone.inverses.push_back(*inverse_of(affine_of(Kind::transform(*placed))));
            alone_.push_back(std::move(alone));
        }
        for (const MeshD& mesh : layout_.meshes)
            trees_.push_back(build_bvh(Kind::mesh(mesh), {.builder = Builder::karras}));
        rays_ =
            Kind::rays(digest_rays(some_triangles(layout_, 20), ray_count, instance_digest_seed));
        see_by_masks();
        add_rays_to_hits(rays_, closest_of_each_alone(), rays_to_hits);
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
    [[nodiscard]] std::size_t rays() const { return rays_.size(); }
    [[nodiscard]] std::shared_ptr<Scene> scene(const SceneOptions& options) const {
        return std::make_shared<Scene>(scene_of<Kind>(layout_, options));
    }

    [[nodiscard]] Answer closest(const Scene& scene, typename Scene::TraceOptions options) const {
        options.masks = masks_;
        return answer(trace(scene, rays_, options));
    }
    [[nodiscard]] Answer closest_one_by_one(const Scene& scene) const {
        Hits hits;
        for (std::size_t i = 0; i < rays_.size(); ++i)
            hits.push_back(closest_hit(scene, rays_[i], masks_[i]));
        return answer(hits);
    }
    /// Of calls with one mask for all their rays.
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
    /// By the binary tree of every mesh on every path.
    [[nodiscard]] Hits closest_of_each_alone() const {
        Hits hits;
        for (std::size_t i = 0; i < rays_.size(); ++i) {
            typename Kind::SceneHit best;
            for (const Alone& alone : alone_) {
                if (!alone.seen_by(masks_[i])) continue;
                const auto hit =
                    closest_hit(trees_[alone.shown.mesh], Kind::inside(rays_[i], alone.inverses));
                if (!hit.hit()) continue;
                const bool nearer = !best.hit() || hit.t < best.t;
                if (nearer || (hit.t == best.t && alone.shown.number < best.instance))
                    best = {hit, 0, alone.shown.number};
            }
            hits.push_back(best);
        }
        return hits;
    }
    [[nodiscard]] Answer any(const Scene& scene, typename Scene::TraceOptions options) const {
        std::vector<std::uint8_t> occluded(rays_.size());
        options.masks = masks_;
        trace_any(scene, rays_, occluded, options);
        return answer_any(occluded);
    }

    [[nodiscard]] static Answer answer(const Hits& hits) {
        Answer out;
        for (const auto& hit : hits) {
            out.values.add_hit(hit);
            out.where.add(hit.hit() ? hit.geometry : no_primitive)
                .add(hit.hit() ? hit.instance : no_primitive);
            out.found += hit.hit();
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
        std::vector<typename Kind::Inverse> inverses;

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
    std::vector<typename Kind::Tree> trees_;
    std::vector<AnyRay> rays_;
    std::vector<std::uint32_t> masks_;
};

constexpr std::pair<const char*, Quality> qualities[] = {
    {"balanced", Quality::balanced},
#if !defined(RAYDIX_EMULATED) && !defined(RAYDIX_SANITIZED)
    {"fast", Quality::fast},
    {"high", Quality::high},
#endif
};
constexpr SimdPath paths[] = {
    SimdPath::single,    SimdPath::packet, SimdPath::stream,
#if !defined(RAYDIX_EMULATED) && !defined(RAYDIX_SANITIZED)
    SimdPath::automatic, SimdPath::sorted,  // which choose among the others
#endif
};

/// Adds a way for each quality and each of several ways through the trees. answer(scene, options).
template <class Kind, class Ask>
void add_ways(Question& question, const std::shared_ptr<Traced<Kind>>& traced, const Ask& ask) {
    for (const auto& [name, quality] : qualities) {
        const auto built = traced->scene({.quality = quality});
        for (const SimdPath path : paths) {
            typename Traced<Kind>::Scene::TraceOptions options;
            options.path = path;
            options.threads = 1 + static_cast<int>(path) % 2;
            const std::string way = fmt::format("{}, path {}", name, static_cast<int>(path));
            question.ways.push_back({way, [=] { return ask(*traced, *built, options); }});
        }
    }
}

template <class Kind>
Question closest_question(const std::shared_ptr<Traced<Kind>>& traced) {
    Question question{traced->input(), traced->rays() / 5, {}};
    add_ways(question, traced, [](const auto& all, const auto& scene, const auto& options) {
        return all.closest(scene, options);
    });
    const auto built = traced->scene({.compact = true});
    question.ways.push_back({"one by one", [=] { return traced->closest_one_by_one(*built); }});
    question.ways.push_back({"a mask a call", [=] { return traced->closest_by_mask(*built); }});
    question.ways.push_back(
        {"each alone", [=] { return traced->answer(traced->closest_of_each_alone()); }});
    return question;
}

template <class Kind>
Question any_question(const std::shared_ptr<Traced<Kind>>& traced) {
    Question question{traced->input(), traced->rays() / 5, {}};
    add_ways(question, traced, [](const auto& all, const auto& scene, const auto& options) {
        return all.any(scene, options);
    });
    question.ways.push_back({"each alone", [=] {
                                 std::vector<std::uint8_t> hit_or_miss;
                                 for (const auto& hit : traced->closest_of_each_alone())
                                     hit_or_miss.push_back(hit.hit());
                                 return traced->answer_any(hit_or_miss);
                             }});
    return question;
}

template <class Kind>
Question ask(const std::string& layout, const std::string& query) {
    const auto traced = std::make_shared<Traced<Kind>>(layout);
    return query == "closest" ? closest_question(traced) : any_question(traced);
}
Question ask_scene(const std::string& scene, const std::string& query) {
    const std::string layout = scene.substr(scene.find(' ') + 1);
    return scene.starts_with("float") ? ask<InFloat>(layout, query) : ask<InDouble>(layout, query);
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
    expect_known(GetParam(), ask_scene(GetParam().scene, GetParam().query));
}

INSTANTIATE_TEST_SUITE_P(Layouts, InstanceDigest, testing::ValuesIn(known),
                         [](const auto& row) { return name_of(row.param); });

}  // namespace
}  // namespace raydix::test
