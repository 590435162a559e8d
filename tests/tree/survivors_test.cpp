// Which clusters of a block stay and which of them merge, against the definition, one place at once
// and sixteen; nothing behind a block's survivors is written.
#include "tree/survivors.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace raydix {
namespace {

class KeepSurvivors : public testing::TestWithParam<bool> {};

TEST_P(KeepSurvivors, CopiesThoseThatStay) {
    if (GetParam() && !has_wide_survivors()) GTEST_SKIP() << "this processor has no AVX-512";
    constexpr unsigned seed = 5;
    std::mt19937 random(seed);
    for (const std::uint32_t n : {1u, 2u, 15u, 16u, 17u, 31u, 100u, 511u, partner_block})
        for (const std::uint32_t begin : {0u, partner_block})
            for (const bool named : {false, true}) {
                const std::uint32_t end = begin + n;
                std::vector<std::int8_t> partners(end);
                std::vector<float> lanes[6], to[6];
                std::vector<ClusterRef> refs(end), to_refs(n + 1, 77u);
                for (std::uint32_t i = 0; i < end; ++i) {
                    partners[i] = static_cast<std::int8_t>(static_cast<int>(random() % 7) - 3);
                    refs[i] = static_cast<ClusterRef>(random());
                }
                ListCopy copy{{}, named ? refs.data() : nullptr, {}, to_refs.data()};
                for (std::size_t c = 0; c < 6; ++c) {
                    for (std::uint32_t i = 0; i < end; ++i)
                        lanes[c].push_back(static_cast<float>(random() % 1000));
                    to[c].assign(n + 1, -5.0f);
                    copy.lanes[c] = lanes[c].data();
                    copy.to_lanes[c] = to[c].data();
                }
                Survivors found;
                keep_survivors(partners.data(), begin, end, copy, found, GetParam());
                std::uint32_t count = 0, pairs = 0;
                for (std::uint32_t i = begin; i < end; ++i) {
                    if (partners[i] < 0) continue;
                    if (partners[i] > 0) {
                        ASSERT_EQ(found.pairs[pairs++], count) << n;
                    }
                    ASSERT_EQ(found.places[count], i) << n;
                    for (std::size_t c = 0; c < 6; ++c) ASSERT_EQ(to[c][count], lanes[c][i]);
                    ASSERT_EQ(to_refs[count], named ? refs[i] : primitive_cluster | i);
                    ++count;
                }
                EXPECT_EQ(found.count, count) << n;
                EXPECT_EQ(found.pair_count, pairs) << n;
                EXPECT_EQ(to_refs[count], 77u) << n;
                for (const auto& lane : to) EXPECT_EQ(lane[count], -5.0f) << n;
            }
}

INSTANTIATE_TEST_SUITE_P(Width, KeepSurvivors, testing::Bool(),
                         [](const auto& p) { return p.param ? "sixteen" : "one"; });

}  // namespace
}  // namespace raydix
