// Commits that tell how far they are, and that end at any of these calls: the scene stays as it
// was, and a later commit gives what one without the first attempt gives.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

struct Enough {};

Transform placed(float x, float turn) {
    Transform t;
    t.m[0][1] = turn, t.m[2][0] = -turn, t.m[0][3] = x;
    return t;
}

/// A scene that was committed, and changes of it.
struct Case {
    std::string name;
    SceneOptions options;
    std::size_t triangles;  // of the largest mesh
    std::size_t least_calls;
};

class World {
public:
    explicit World(const Case& c) : object_(test::random_soup(300, 1)), case_(c) {
        pair_.add(object_, placed(1, 0.5f));
        pair_.add(object_, placed(-1, 0.25f));
        pair_.add(test::random_soup(20, 2));
        pair_.commit();
        for (std::uint64_t k = 0; k < 3; ++k) scene.add(test::random_soup(100 + 400 * k, k, 0.1f));
        scene.add(large(0));
        scene.add(object_, placed(2, 0));
        scene.add(pair_, placed(0, 0.125f));
        scene.commit(c.options);
    }
    /// Meshes that move a little, or much; new ones; instances that move, come and go.
    void change() {
        scene.update(1, moved(test::random_soup(500, 1, 0.1f), 0.001f));
        scene.update(2, test::random_soup(900, 77, 0.1f));
        scene.update(3, large(0.001f));
        scene.remove(0);
        scene.add(test::random_soup(60, 5));
        scene.set_transform(4, placed(-2, 0.5f));
        scene.remove(5);
        scene.add(pair_, placed(0.5f, 1));
        scene.set_mask(2, 3);
    }

    Scene scene;

private:
    static Mesh moved(Mesh mesh, float by) {
        for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
            mesh.vertices[i].x += by * static_cast<float>(i % 7);
        return mesh;
    }
    [[nodiscard]] Mesh large(float by) const {
        return moved(test::random_soup(case_.triangles, 9), by);
    }

    Scene object_, pair_;
    Case case_;
};

std::vector<Ray> some_rays() {
    test::Random random(4);
    std::vector<Ray> rays;
    for (int i = 0; i < 200; ++i) {
        const Vec3 from = random.in(-3, 4), to = random.in(-1, 2);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
    }
    return rays;
}

/// All that can be seen of a commit.
struct Sight {
    std::vector<Hit> hits;
    AllHits all;
    Aabb bounds;
    std::vector<std::uint32_t> path;

    explicit Sight(const Scene& scene)
        : hits(trace(scene, some_rays(), {.threads = 1})),
          all(trace_all(scene, some_rays(), {.threads = 1})),
          bounds(scene.bounds()),
          path(scene.path(4)) {}

    friend bool operator==(const Sight& a, const Sight& b) {
        const auto same = [](const std::vector<Hit>& x, const std::vector<Hit>& y) {
            return x.size() == y.size() &&
                   std::memcmp(x.data(), y.data(), x.size() * sizeof(Hit)) == 0;
        };
        return same(a.hits, b.hits) && same(a.all.hits, b.all.hits) &&
               a.all.offsets == b.all.offsets && a.path == b.path &&
               std::memcmp(&a.bounds, &b.bounds, sizeof(Aabb)) == 0;
    }
};

bool same(const CommitReport& a, const CommitReport& b) {
    return a.meshes == b.meshes && a.instances == b.instances && a.triangles == b.triangles &&
           a.trees_built == b.trees_built && a.trees_refitted == b.trees_refitted &&
           a.sah_ratio == b.sah_ratio && a.bytes == b.bytes && a.paths == b.paths;
}

/// Commits until call `last`, counted from 0, which throws. The parts told.
std::vector<double> commit_until(Scene& scene, SceneOptions options, std::size_t last) {
    std::vector<double> parts;
    options.progress = [&](double part) {
        parts.push_back(part);
        if (parts.size() == last + 1) throw Enough();
    };
    EXPECT_THROW(scene.commit(options), Enough);
    return parts;
}

const std::vector<Case>& cases() {
    static const std::vector<Case> all = {
        {"fixed, balanced", {}, 2000, 8},
        {"fixed, fast", {.quality = Quality::fast}, 2000, 5},
        {"fixed, high, compact", {.quality = Quality::high, .compact = true}, 2000, 6},
        {"moving, balanced", {.usage = Usage::moving}, 2000, 12},
        {"moving, high", {.quality = Quality::high, .usage = Usage::moving}, 2000, 12},
        {"moving, fast", {.quality = Quality::fast, .usage = Usage::moving}, 2000, 8},
        {"moving, never refitted", {.usage = Usage::moving, .refit_limit = 0}, 2000, 12},
        {"fixed, large", {}, test::fewer(40000, 2), test::fewer(60, 2)},
        {"fixed, high, large", {.quality = Quality::high}, test::fewer(20000, 2), 15},
        {"fixed, fast, large", {.quality = Quality::fast}, test::fewer(100000, 2), 20},
    };
    return all;
}

TEST(SceneProgress, ACommitThatEndsAtAnyCallLeavesTheSceneAsItWas) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        SceneOptions options = c.options;
        options.threads = 1;
        World wanted(c);
        const Sight before(wanted.scene);
        wanted.change();
        std::vector<double> parts;
        options.progress = [&](double part) { parts.push_back(part); };
        const CommitReport report = wanted.scene.commit(options);
        const Sight after(wanted.scene);
        EXPECT_FALSE(before == after);
        EXPECT_TRUE(std::ranges::is_sorted(parts));
        EXPECT_GE(parts.size(), c.least_calls);
        EXPECT_LE(parts.size(), 257u);
        EXPECT_LT(parts.front(), 0.5);
        EXPECT_EQ(parts.back(), 1.0);

        World world(c);
        world.change();
        const std::size_t stride = parts.size() > 40 ? parts.size() / (2 * test::thorough) : 1;
        const auto after_call = [&](std::size_t k) {
            if (k + 1 + stride < parts.size()) return k + stride;
            return test::thorough > 1 ? k + 1 : std::max(k + 1, parts.size() - 1);
        };
        for (std::size_t k = 0; k < parts.size(); k = after_call(k)) {
            const std::vector<double> told = commit_until(world.scene, options, k);
            EXPECT_TRUE(std::ranges::equal(told, std::span(parts).first(k + 1))) << k;
            EXPECT_FALSE(world.scene.committed());
            if (k % 5 == 0 || k + 1 == parts.size()) {
                EXPECT_TRUE(Sight(world.scene) == before) << k;
            }
        }
        options.progress = nullptr;
        EXPECT_TRUE(same(world.scene.commit(options), report));
        EXPECT_TRUE(world.scene.committed());
        EXPECT_TRUE(Sight(world.scene) == after);
        EXPECT_EQ(world.scene.commit(options).trees_built, 0u);
    }
}

TEST(SceneProgress, ManyThreadsCallOneAtATimeAndNoMoreAfterOneThatThrows) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        SceneOptions options = c.options;
        options.threads = 4;
        World world(c);
        const Sight before(world.scene);
        world.change();
        for (const std::size_t k : {std::size_t{0}, c.least_calls / 3, c.least_calls / 2}) {
            EXPECT_EQ(commit_until(world.scene, options, k).size(), k + 1);
            EXPECT_FALSE(world.scene.committed());
            EXPECT_TRUE(Sight(world.scene) == before);
        }
        std::vector<double> parts;
        options.progress = [&](double part) {
            parts.push_back(part);
            // The last commit answers meanwhile.
            if (parts.size() % 8 == 1) {
                EXPECT_TRUE(Sight(world.scene) == before);
            }
        };
        world.scene.commit(options);
        EXPECT_TRUE(std::ranges::is_sorted(parts));
        EXPECT_GE(parts.size(), c.least_calls / 2);
        EXPECT_EQ(parts.back(), 1.0);
        World other(c);
        other.change();
        other.scene.commit(c.options);
        EXPECT_TRUE(Sight(world.scene) == Sight(other.scene));
    }
}

TEST(SceneProgress, LongBuildsTellSmallSteps) {
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high}) {
        Scene scene;
        scene.add(test::random_soup(10000 * test::thorough, 3));
        SceneOptions options{.quality = quality, .threads = 1};
        double last = 0, widest = 0;
        options.progress = [&](double part) {
            widest = std::max(widest, part - last);
            last = part;
        };
        scene.commit(options);
        EXPECT_EQ(last, 1.0);
        if (test::thorough > 1) {
            EXPECT_LT(widest, 0.4) << static_cast<int>(quality);
        }
    }
}

TEST(SceneProgress, MeshesCountByTheirTriangles) {
    Scene scene;
    scene.add(test::random_soup(9000, 1));
    for (std::uint64_t k = 0; k < 10; ++k) scene.add(test::random_soup(100, k));
    SceneOptions options{.usage = Usage::moving, .threads = 1};
    std::vector<double> parts;
    options.progress = [&](double part) { parts.push_back(part); };
    scene.commit(options);
    // The tenth that the small ones are, from one to the next.
    const auto small = std::ranges::count_if(parts, [](double p) { return p > 0.9 && p < 1; });
    EXPECT_GE(small, 8);
    EXPECT_GE(parts.size(), 20u);
    // What is kept counts for nothing.
    parts.clear();
    scene.update(4, test::random_soup(300, 4));
    scene.commit(options);
    EXPECT_LT(parts.front(), 0.5);
    parts.clear();
    scene.commit(options);
    EXPECT_EQ(parts.back(), 1.0);
}

TEST(SceneProgress, OfNothingIsOne) {
    Scene scene;
    std::vector<double> parts;
    SceneOptions options;
    options.progress = [&](double part) { parts.push_back(part); };
    scene.commit(options);
    EXPECT_EQ(parts, std::vector<double>{1.0});
    Scene never;
    never.add(test::random_soup(10, 1));
    EXPECT_FALSE(commit_until(never, {}, 0).empty());
    EXPECT_FALSE(never.committed());
    EXPECT_THROW(static_cast<void>(never.bounds()), InputError);
    // Errors come out as before, and leave the scene as it was.
    Scene holder;
    holder.add(never, Transform{});
    EXPECT_THROW(holder.commit(options), InputError);
    EXPECT_FALSE(holder.committed());
}

}  // namespace
}  // namespace raydix
