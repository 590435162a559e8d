// Single calls: the same hits as `scalar`, bit for bit, whether or not a thread's rays follow each
// other, for every instruction set.
#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/rays.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <thread>
#include <vector>

#include "layout/wide_bvh.h"
#include "support/bits.h"
#include "trace/simd/simd_kernels.h"

namespace raydix::test {
namespace {

struct View {
    Bvh bvh;
    std::vector<Ray> rays;
    std::vector<Hit> hits;
};
View atrium_view(std::uint32_t size) {
    View view;
    const Model scene = load_model("builtin:atrium?triangles=20000", 4);
    view.bvh = build_bvh(scene.mesh(), {.builder = Builder::ploc});
    view.rays = make_primary_rays(scene.cameras.cameras.at(0), size, size);
    view.hits = trace(view.bvh, view.rays);
    return view;
}

TEST(SingleCalls, FindTheSameWhateverCameBefore) {
    const View view = atrium_view(64);
    for (const WideBvhOptions options :
         {WideBvhOptions{}, WideBvhOptions{.width = 4}, WideBvhOptions{.compact = true}}) {
        const WideBvh tree(view.bvh, options);
        const std::size_t room = wide_stack_capacity(tree.stats().max_depth);
        const WideView in = view_of(tree.arrays());
        std::vector<std::uint32_t> words(room);
        std::vector<float> entries(room);
        for (const SimdKernels& kernels : simd_kernels())
            for (const int agreeing : {0, CallHistory::most}) {
                SCOPED_TRACE(std::string(kernels.isa) + ", width " + std::to_string(options.width) +
                             (options.compact ? ", compact, " : ", ") + std::to_string(agreeing));
                std::size_t different = 0, coherent = 0;
                for (std::size_t i = 0; i < view.rays.size(); ++i) {
                    CallHistory history;
                    history.agreeing = agreeing;
                    const WideStackView stack{words.data(), entries.data()};
                    const Hit hit = hit_of_tree(kernels.closest(in, view.rays[i], stack, history));
                    coherent += history.is_coherent();
                    different += !same_bits(hit, view.hits[i]);
                    const TreeHit any = kernels.any(in, view.rays[i], stack, history);
                    different += any.hit() != view.hits[i].hit();
                }
                EXPECT_EQ(different, 0u);
                EXPECT_EQ(coherent, agreeing == 0 ? 0u : view.rays.size());
            }
    }
}

TEST(SingleCalls, InAnyOrderAndOnAnyThread) {
    const View view = atrium_view(96);
    const WideBvh tree(view.bvh);
    std::vector<std::size_t> order(view.rays.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    const auto count_different = [&](std::span<const std::size_t> part) {
        std::size_t different = 0;
        for (const std::size_t k : part) {
            different += !same_bits(closest_hit(tree, view.rays[k]), view.hits[k]);
            different += any_hit(tree, view.rays[k]) != view.hits[k].hit();
        }
        return different;
    };
    EXPECT_EQ(count_different(order), 0u);
    std::shuffle(order.begin(), order.end(), std::mt19937(3));
    std::size_t here = 1, there = 1;
    const std::size_t half = order.size() / 2;
    std::thread other([&] { there = count_different(std::span(order).first(half)); });
    here = count_different(std::span(order).subspan(half));
    other.join();
    EXPECT_EQ(here, 0u);
    EXPECT_EQ(there, 0u);
}

TEST(SingleCalls, TellRaysThatFollowEachOtherFromOthers) {
    const View view = atrium_view(64);
    const WideBvh tree(view.bvh);
    const std::size_t room = wide_stack_capacity(tree.stats().max_depth);
    const WideView in = view_of(tree.arrays());
    std::vector<std::uint32_t> words(room);
    std::vector<float> entries(room);
    const auto coherent_part = [&](std::span<const Ray> rays) {
        CallHistory history;
        std::size_t coherent = 0;
        for (const Ray& ray : rays) {
            simd_kernels().front().closest(in, ray, {words.data(), entries.data()}, history);
            coherent += history.is_coherent();
        }
        return static_cast<double>(coherent) / static_cast<double>(rays.size());
    };
    EXPECT_GT(coherent_part(view.rays), 0.9);
    // Origins all over the scene, directions everywhere.
    std::vector<Ray> strewn = view.rays;
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(-1, 1), part(0, 1);
    const Vec3 lo = view.bvh.bounds().lo, size = view.bvh.bounds().hi - lo;
    for (Ray& ray : strewn) {
        ray.origin = {lo.x + part(random) * size.x, lo.y + part(random) * size.y,
                      lo.z + part(random) * size.z};
        ray.direction = {unit(random), unit(random), 0.9f + 0.1f * unit(random)};
    }
    EXPECT_LT(coherent_part(strewn), 0.1);
}

TEST(SingleCalls, HistoryChangesItsMindSlowly) {
    CallHistory history;
    for (int k = 0; k < CallHistory::enough; ++k) {
        EXPECT_FALSE(history.is_coherent());
        history.add(true);
    }
    EXPECT_TRUE(history.is_coherent());
    for (int k = 0; k < 100; ++k) history.add(true);
    EXPECT_EQ(history.agreeing, CallHistory::most);
    history.add(false);
    EXPECT_TRUE(history.is_coherent());
    for (int k = 0; k < 100; ++k) history.add(false);
    EXPECT_EQ(history.agreeing, 0);
}

}  // namespace
}  // namespace raydix::test
