// What whole scenes as one body are told to take, before anything is made, is more than they take;
// result_limit_test.cpp counts all memory of this program.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/scene_pairs.h>
#include <raydix/solid.h>

#include <cstdint>
#include <functional>
#include <iostream>
#include <string>

#include "exec/memory.h"
#include "support/double_scenes.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

/// `copies` of a mesh on two levels, and the mesh itself.
template <class Scalar, class AnyMesh>
BasicScene<Scalar> scene_of_copies(const AnyMesh& mesh, int copies, Quality quality) {
    BasicTransform<Scalar> place;
    BasicScene<Scalar> pair, scene;
    for (int k = 0; k < 2; ++k) {
        place.m[0][3] = static_cast<Scalar>(k) * Scalar(0.25);
        pair.add(BasicScene<Scalar>(mesh), place);
    }
    pair.commit();
    scene.add(mesh);
    for (int k = 0; k < copies / 2; ++k) {
        place.m[1][3] = static_cast<Scalar>(k) * Scalar(2.5);
        scene.add(pair, place);
    }
    scene.commit({.quality = quality});
    return scene;
}

/// Holds the call to what it says: all that it needs or, unless `exact`, that it needs more.
void expect_bound(const std::string& name, const std::function<void(std::uint64_t limit)>& call,
                  bool exact = true) {
    SCOPED_TRACE(name);
    std::uint64_t told = 0;
    const std::uint64_t before = memory_count().now();
    memory_count().restart_peak();
    try {
        call(1);
    } catch (const ResultTooLarge& error) {
        told = error.bytes();
        EXPECT_EQ(error.is_exact(), exact);
    }
    ASSERT_GT(told, 0u);
    const std::uint64_t refused = memory_count().peak() - before;
    EXPECT_LT(refused, 20'000u) << "nothing is made before";
    memory_count().restart_peak();
    call(0);
    const std::uint64_t peak = memory_count().peak() - before;
    std::cout << name << ": told " << told << " bytes, held " << peak << "\n";
    if (!test::sanitized) {
        EXPECT_LE(peak, told + (64 << 10));
    }
    EXPECT_GT(peak, told / 4);
}

TEST(SceneLimits, BodiesTakeNoMoreThanTheySay) {
    const Mesh mesh = test::random_soup(test::thorough > 1 ? 4000 : 1000, 3, 0.02f);
    for (const Quality quality : {Quality::fast, Quality::balanced}) {
        const std::string which = quality == Quality::fast ? ", fast" : ", balanced";
        const Scene many = scene_of_copies<float>(mesh, 6, quality);
        const SceneD in_doubles = scene_of_copies<double>(test::in_double(mesh), 6, quality);
        const Scene one(mesh, {.quality = quality});
        for (const InsideRule rule : {InsideRule::crossings, InsideRule::winding}) {
            const std::string name =
                (rule == InsideRule::winding ? "solid, winding" : "solid, crossings") + which;
            const auto options = [&](std::uint64_t limit) {
                return SceneSolidOptions{.rule = rule, .max_result_bytes = limit, .threads = 1};
            };
            expect_bound(name, [&](std::uint64_t limit) { Solid(many, options(limit)); });
            expect_bound(name + ", one mesh",
                         [&](std::uint64_t limit) { Solid(one, options(limit)); });
            expect_bound(name + ", double",
                         [&](std::uint64_t limit) { SolidD(in_doubles, options(limit)); });
        }
        // Pairs are few here: what counts is the copies and their trees.
        const auto pairs_of = [](const auto& scene) {
            return [&](std::uint64_t limit) {
                static_cast<void>(overlapping_pairs(
                    scene, {.narrow = true, .max_result_bytes = limit, .threads = 1}));
            };
        };
        expect_bound("pairs" + which, pairs_of(many), false);
        expect_bound("pairs in double" + which, pairs_of(in_doubles), false);
    }
}

/// A call with as much as an error names exactly passes, and one with as much as it names as too
/// little is refused. call(limit)
void expect_true_errors(const std::function<void(std::uint64_t limit)>& call) {
    std::uint64_t limit = 1;
    for (int tries = 0; tries < 40; ++tries) {
        try {
            call(limit);
            return;
        } catch (const ResultTooLarge& error) {
            const std::uint64_t named = error.bytes();
            ASSERT_GE(named, limit);
            if (error.is_exact()) {
                EXPECT_NO_THROW(call(named));
            } else {
                EXPECT_THROW(call(named), ResultTooLarge) << named;
            }
            limit = named + 1 + named / 8;
        }
    }
    FAIL() << "no limit is enough";
}

TEST(SceneLimits, PairsPassWithWhatTheErrorNames) {
    const Mesh mesh = test::random_soup(400, 3, 2.0f);  // many pairs
    const Scene scene(mesh), other(test::random_soup(300, 4, 2.0f));
    expect_true_errors([&](std::uint64_t limit) {
        static_cast<void>(overlapping_pairs(scene, {.max_result_bytes = limit, .threads = 1}));
    });
    expect_true_errors([&](std::uint64_t limit) {
        static_cast<void>(
            overlapping_pairs(scene, other, {.max_result_bytes = limit, .threads = 1}));
    });
    expect_true_errors([&](std::uint64_t limit) {
        static_cast<void>(
            count_overlapping_pairs(scene, {.max_result_bytes = limit, .threads = 1}));
    });
}

}  // namespace
}  // namespace raydix
