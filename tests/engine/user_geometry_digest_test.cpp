// Rays through shapes and geometry of the caller's own in scenes, in float and in double, against
// digests kept here: functions written in this test, and the shapes of the library as they are.
#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/user_geometry.h>

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>

#include "base/double3.h"
#include "engine/box_hits.h"
#include "engine/shape_tree.h"
#include "proximity/shape_hits.h"
#include "support/digest_inputs.h"
#include "support/digests.h"
#include "support/double_scenes.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t user_geometry_digest_seed = 12;
constexpr std::size_t ray_count = 4000, rays_to_hits = 500, shape_count = 300;

struct FloatCalls {
    using Number = float;
    using Point = Vec3;
    using Box = Aabb;
    using AnyRay = Ray;
    using AnyHit = Hit;
    using Ball = Sphere;
    using Rod = Capsule;
    using Scene = raydix::Scene;

    static Point point(Vec3d p) { return Double3(p).rounded(); }
    static AabbD wide(const Box& box) {
        return {{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}};
    }
    static std::vector<Ray> rays(const std::vector<RayD>& rays) { return in_float(rays); }
};

struct DoubleCalls {
    using Number = double;
    using Point = Vec3d;
    using Box = AabbD;
    using AnyRay = RayD;
    using AnyHit = HitD;
    using Ball = SphereD;
    using Rod = CapsuleD;
    using Scene = SceneD;

    static Point point(Vec3d p) { return p; }
    static AabbD wide(const Box& box) { return box; }
    static std::vector<RayD> rays(const std::vector<RayD>& rays) { return rays; }
};

/// A sphere's surface; u and v are the point's offsets from the center in x and y.
template <class Ball, class AnyRay, class AnyHit>
bool hits_ball(const Ball& ball, const AnyRay& ray, AnyHit& hit) {
    const Double3 d(ray.direction), o = Double3(ray.origin) - Double3(ball.center);
    const double a = dot(d, d), b = dot(o, d), radius = ball.radius;
    const double c = b * b - a * (dot(o, o) - radius * radius);
    if (!(c >= 0.0)) return false;
    const double root = std::sqrt(c);
    if (!first_within(ray, (-b - root) / a, (root - b) / a, hit)) return false;
    using Number = decltype(hit.t);
    hit.u = static_cast<Number>(o.x + hit.t * d.x);
    hit.v = static_cast<Number>(o.y + hit.t * d.y);
    return true;
}

/// Shapes, the boxes around them and the function that knows them. The shapes stay where they are.
template <class Calls>
struct TestShapes {
    using Number = typename Calls::Number;
    using AnyShapes = BasicShapes<Number>;
    using AnyRay = typename Calls::AnyRay;
    using AnyHit = typename Calls::AnyHit;
    static constexpr Number one_radius{0.0625};

    std::vector<typename Calls::Ball> balls;
    std::vector<typename Calls::Rod> rods;
    std::vector<typename Calls::Point> points;
    std::vector<typename Calls::Box> boxes;
    std::function<bool(std::uint32_t prim, const AnyRay& ray, AnyHit& hit)> intersect;

    explicit TestShapes(const std::string& name) : random_(user_geometry_digest_seed) {
        if (name.starts_with("far")) middle_ = utm_place;
        if (name == "my boxes") {
            make_boxes();
            intersect = [this](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                return hits_box(boxes[prim], ray, hit);
            };
        } else if (name.ends_with("spheres")) {
            make_balls();
            boxes = boxes_of<Number>(std::span<const typename Calls::Ball>(balls));
            const bool mine = name.starts_with("my");
            intersect = [this, mine](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                return mine ? hits_ball(balls[prim], ray, hit)
                            : hit_ball(balls[prim].center, balls[prim].radius, ray, hit);
            };
        } else if (name.ends_with("capsules")) {
            for (std::size_t i = 0; i < shape_count; ++i) {
                const Vec3d a = place(), along = 0.2 * in_cube();
                const Vec3d b = i % 9 == 0 ? a : a + along;
                rods.push_back({Calls::point(a), Calls::point(b), radius()});
            }
            boxes = boxes_of<Number>(std::span<const typename Calls::Rod>(rods));
            intersect = [this](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                return hit_capsule(rods[prim], ray, hit);
            };
        } else {
            for (std::size_t i = 0; i < shape_count; ++i) points.push_back(Calls::point(place()));
            boxes = boxes_of<Number>(BasicBalls<Number>{points, one_radius});
            intersect = [this](std::uint32_t prim, const AnyRay& ray, AnyHit& hit) {
                return hit_ball(points[prim], one_radius, ray, hit);
            };
        }
    }
    TestShapes(const TestShapes&) = delete;

private:
    Vec3d in_cube() { return random_.in({{-1, -1, -1}, {1, 1, 1}}); }
    Vec3d place() { return middle_ + in_cube(); }
    Number radius() { return static_cast<Number>(random_.between(0.01, 0.2)); }
    /// Every tenth is the one before it: they tie.
    void make_balls() {
        for (std::size_t i = 0; i < shape_count; ++i) {
            const Vec3d center = place();
            balls.push_back({Calls::point(center), radius()});
            if (i % 10 == 9) balls[i] = balls[i - 1];
        }
    }
    /// Corners on a lattice, so that sides lie in the same planes; some are flat.
    void make_boxes() {
        const auto whole = [&] { return 0.125 * (static_cast<double>(random_.below(17)) - 8); };
        const auto size = [&] { return 0.125 * static_cast<double>(random_.below(4)); };
        for (std::size_t i = 0; i < shape_count; ++i) {
            const Vec3d lo{whole(), whole(), whole()}, by{size(), size(), size()};
            boxes.push_back({Calls::point(lo), Calls::point(lo + by)});
        }
    }

    RandomD random_;
    Vec3d middle_{0, 0, 0};
};

template <class Calls>
class Traced {
public:
    using Scene = typename Calls::Scene;
    using Hits = std::vector<typename Calls::AnyHit>;

    explicit Traced(const std::string& name) : shapes_(name) {
        std::vector<AabbD> wide;
        for (const auto& box : shapes_.boxes) wide.push_back(Calls::wide(box));
        rays_ = Calls::rays(digest_rays(across(wide), ray_count, user_geometry_digest_seed));
        add_rays_to_hits(rays_, trace(*scene(true, Quality::fast), rays_), rays_to_hits);
    }

    [[nodiscard]] Packed input() const {
        Packed packed;
        for (const auto& box : shapes_.boxes) packed.add(box.lo).add(box.hi);
        return packed.add_all(rays_);
    }
    [[nodiscard]] std::size_t rays() const { return rays_.size(); }
    /// As one geometry of a scene.
    [[nodiscard]] std::shared_ptr<const Scene> scene(bool as_user_geometry, Quality quality) const {
        auto scene = std::make_shared<Scene>();
        if (as_user_geometry)
            scene->add(BasicUserGeometry<typename Calls::Number>(shapes_.boxes, shapes_.intersect));
        else if (!shapes_.balls.empty())
            scene->add(std::span<const typename Calls::Ball>(shapes_.balls));
        else if (!shapes_.rods.empty())
            scene->add(std::span<const typename Calls::Rod>(shapes_.rods));
        else
            scene->add(std::span<const typename Calls::Point>(shapes_.points), shapes_.one_radius);
        scene->commit({.quality = quality});
        return scene;
    }
    [[nodiscard]] Answer ask(const Scene& scene, bool any, SimdPath path, int threads) const {
        typename Scene::TraceOptions options;
        options.path = path, options.threads = threads;
        if (!any) return answer(trace(scene, rays_, options));
        std::vector<std::uint8_t> occluded(rays_.size());
        trace_any(scene, rays_, occluded, options);
        return answer_any(occluded);
    }
    [[nodiscard]] Answer ask_one_by_one(const Scene& scene, bool any) const {
        Hits hits;
        std::vector<std::uint8_t> occluded;
        for (const auto& ray : rays_)
            any ? occluded.push_back(any_hit(scene, ray)) : hits.push_back(closest_hit(scene, ray));
        return any ? answer_any(occluded) : answer(hits);
    }
    /// Without any tree.
    [[nodiscard]] Hits each_shape() const {
        Hits best(rays_.size());
        for (std::size_t i = 0; i < rays_.size(); ++i)
            for (std::uint32_t prim = 0; prim < shapes_.boxes.size(); ++prim) {
                typename Calls::AnyHit hit;
                if (!shapes_.intersect(prim, rays_[i], hit)) continue;
                hit.t += 0;  // no -0
                hit.prim = prim;
                if (hit.t < best[i].t) best[i] = hit;
            }
        return best;
    }

    static Answer answer(const Hits& hits) {
        Answer out;
        for (const auto& hit : hits) {
            out.values.add_hit(hit);
            out.found += hit.hit();
        }
        return out;
    }
    static Answer answer_any(const std::vector<std::uint8_t>& occluded) {
        Answer out;
        out.values.add_all(occluded);
        for (const std::uint8_t hit : occluded) out.found += hit;
        return out;
    }

private:
    TestShapes<Calls> shapes_;
    std::vector<typename Calls::AnyRay> rays_;
};

template <class Calls>
Question question_of(const std::string& shapes, bool any) {
    const auto traced = std::make_shared<Traced<Calls>>(shapes);
    Question question{traced->input(), traced->rays() / 5, {}};
    const auto add = [&](std::string name, auto answer) {
        question.ways.push_back({std::move(name), answer});
    };
    for (const bool as_user_geometry : {true, false})
        for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high}) {
            if (!as_user_geometry && shapes.starts_with("my")) continue;
            const auto scene = traced->scene(as_user_geometry, quality);
            const std::string name =
                fmt::format("{}quality {}", as_user_geometry ? "user geometry, " : "",
                            static_cast<int>(quality));
            for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                        SimdPath::stream, SimdPath::sorted}) {
                const int threads = 1 + static_cast<int>(path) % 2;
                add(fmt::format("{}, {}", name, simd_path_name(path)),
                    [=] { return traced->ask(*scene, any, path, threads); });
            }
            add(name + ", one by one", [=] { return traced->ask_one_by_one(*scene, any); });
        }
    add("each shape", [=] {
        const auto hits = traced->each_shape();
        if (!any) return traced->answer(hits);
        std::vector<std::uint8_t> occluded;
        for (const auto& hit : hits) occluded.push_back(hit.hit());
        return traced->answer_any(occluded);
    });
    return question;
}

Question ask(const std::string& scene, const std::string& query) {
    const std::string shapes = scene.substr(scene.find(' ') + 1);
    const bool any = query == "any";
    return scene.starts_with("float") ? question_of<FloatCalls>(shapes, any)
                                      : question_of<DoubleCalls>(shapes, any);
}

constexpr Known known[] = {
    {"float my spheres", "closest", "f68ca44b75aab741", "3d613b1c6f0ab3a6", "-"},
    {"float my spheres", "any", "f68ca44b75aab741", "afec706aadf8bf83", "-"},
    {"float my boxes", "closest", "529b8816e9bf117e", "78e837b82382bb01", "-"},
    {"float my boxes", "any", "529b8816e9bf117e", "09a2c4b81fc949a0", "-"},
    {"float spheres", "closest", "f1ab8e7f797749f3", "ad25415d37bc6cc4", "-"},
    {"float spheres", "any", "f1ab8e7f797749f3", "c858a13c5b1de10f", "-"},
    {"float capsules", "closest", "3c347b597722dc27", "8883dfe811a67489", "-"},
    {"float capsules", "any", "3c347b597722dc27", "21b5dab8559486de", "-"},
    {"float points", "closest", "ca9a73573deb81ee", "42dfa668cd768c21", "-"},
    {"float points", "any", "ca9a73573deb81ee", "4f2a9e0292ffddbe", "-"},
    {"double my spheres", "closest", "4047b239554c90ae", "1c68b5bfa1e4600c", "-"},
    {"double my spheres", "any", "4047b239554c90ae", "6807a8efdcc98a84", "-"},
    {"double my boxes", "closest", "77a237d5b82e7456", "8c2224da89e2567b", "-"},
    {"double my boxes", "any", "77a237d5b82e7456", "6046d11ce0465b0a", "-"},
    {"double spheres", "closest", "585bafb7addfacdc", "7526893892c63c19", "-"},
    {"double spheres", "any", "585bafb7addfacdc", "7757079903aa040a", "-"},
    {"double capsules", "closest", "9dd29347250d1367", "030b06689adddec3", "-"},
    {"double capsules", "any", "9dd29347250d1367", "bfbe416327d24c58", "-"},
    {"double far spheres", "closest", "16e09c9e8d351786", "eec678006f6de956", "-"},
    {"double far spheres", "any", "16e09c9e8d351786", "e13fdc3f43649e47", "-"},
    {"double far capsules", "closest", "b5a5b411ba696727", "a5ac1ffc9cb03ea3", "-"},
    {"double far capsules", "any", "b5a5b411ba696727", "3ac7e6bdac5bcef4", "-"},
    {"double points", "closest", "cab69b260e866345", "0eb54a55a405d5b2", "-"},
    {"double points", "any", "cab69b260e866345", "77ed39d7b306f7d0", "-"},
};

class UserGeometryDigest : public testing::TestWithParam<Known> {};

TEST_P(UserGeometryDigest, IsKnown) {
    expect_known(GetParam(), ask(GetParam().scene, GetParam().query));
}

INSTANTIATE_TEST_SUITE_P(Shapes, UserGeometryDigest, testing::ValuesIn(known),
                         [](const auto& row) { return name_of(row.param); });

}  // namespace
}  // namespace raydix::test
