// A change for which memory ends leaves things as they were, whichever of its allocations fails;
// result_limit_test.cpp has the allocations of this program.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/refit.h>
#include <raydix/scene.h>

#include <cstdint>
#include <new>
#include <vector>

#include "exec/memory.h"
#include "limits/memory_end.h"

namespace raydix {
namespace {

/// before(), then change() with an end of memory, then after(); for each allocation of change().
/// Returns how many there are.
template <class Before, class Change, class After>
long at_each_end(const Before& before, const Change& change, const After& after) {
    for (long k = 0;; ++k) {
        before();
        try {
            const MemoryEnd end(k);
            change();
            return k;
        } catch (const std::bad_alloc&) {
        }
        SCOPED_TRACE("allocation " + std::to_string(k));
        after();
    }
}

template <class Scalar>
BasicSphere<Scalar> ball_at(Scalar x) {
    return {{x, 0, 5}, 1};
}
template <class Scalar>
bool hits_at(const BasicScene<Scalar>& scene, Scalar x) {
    return closest_hit(scene, {.origin = {x, 0, 0}, .direction = {0, 0, 1}}).hit();
}

template <class Scalar>
class MemoryEnds : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(MemoryEnds, Scalars);

/// Or the next add gave the same id again and dropped what it was given.
TYPED_TEST(MemoryEnds, AddLeavesTheSceneAsItWas) {
    using Scene = BasicScene<TypeParam>;
    const std::vector<BasicSphere<TypeParam>> first{ball_at<TypeParam>(0)},
        second{ball_at<TypeParam>(10)};
    for (const auto& options : {GeometryOptions{}, GeometryOptions{.id = 7}}) {
        Scene scene;
        const long ends = at_each_end(
            [&] {
                scene = Scene();
                scene.commit();
            },
            [&] { scene.add(first, options); },
            [&] {
                EXPECT_EQ(scene.size(), 0u);
                EXPECT_TRUE(scene.committed());
                EXPECT_EQ(scene.add(second, options), options.id.value_or(0));
                scene.commit();
                EXPECT_TRUE(hits_at<TypeParam>(scene, 10));
                EXPECT_FALSE(hits_at<TypeParam>(scene, 0));
            });
        EXPECT_GE(ends, 3);
    }
}

/// Or the memory of arrays was freed twice.
TYPED_TEST(MemoryEnds, ArraysAreFreedOnce) {
    const BasicMesh<TypeParam> mesh{"m", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    BasicScene<TypeParam> scene;
    std::uint64_t held = 0;
    const long ends = at_each_end(
        [&] {
            scene = BasicScene<TypeParam>();
            held = memory_count().now();
        },
        [&] { scene.add(mesh); },
        [&] {
            EXPECT_EQ(scene.size(), 0u);
            EXPECT_EQ(memory_count().now(), held);
        });
    EXPECT_GE(ends, 5);
}

}  // namespace
}  // namespace raydix
