// The rule that derives costs, by hand for single operations, and what it must give everywhere.
#include "simt/derived_costs.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "simt/cost_model.h"
#include "simt/op.h"

namespace raydix::test {
namespace {

std::uint32_t cost(const std::vector<OperationCost>& costs, std::string_view kernel,
                   std::string_view operation) {
    const auto found = std::find_if(costs.begin(), costs.end(), [&](const OperationCost& c) {
        return c.kernel == kernel && c.operation == operation;
    });
    EXPECT_NE(found, costs.end()) << kernel << ", " << operation;
    return found == costs.end() ? 0 : found->instructions;
}

TEST(DerivedCosts, OfANodeByHand) {
    // 12 multiply-adds, 24 minima and maxima, 4 loads and their address, 12 comparisons, selections
    // and the like, a branch.
    for (const std::string_view kernel : {"while_while", "if_if", "dynamic_fetch"}) {
        EXPECT_EQ(cost(gt200_costs(), kernel, "visit_node"), 12u + 24 + 4 + 1 + 12 + 1);
        EXPECT_EQ(cost(fermi_costs(), kernel, "visit_node"), 12u + 24 + 4 + 1 + 12 + 1);
        EXPECT_EQ(cost(kepler_costs(), kernel, "visit_node"), 12u + 16 + 4 + 1 + 12 + 1);
    }
}

TEST(DerivedCosts, ChargeTheConditionsOfIfIf) {
    for (const auto& costs : {gt200_costs(), fermi_costs(), kepler_costs()}) {
        // Three comparisons, three branches, two notes of where lanes meet again.
        EXPECT_EQ(cost(costs, "if_if", "main_loop"), 8u);
        EXPECT_EQ(cost(costs, "while_while", "node_loop"), 2u);
    }
}

TEST(DerivedCosts, ALoopWrittenOverTwoLinesCostsAllOfItself) {
    for (const auto& costs : {gt200_costs(), fermi_costs(), kepler_costs()}) {
        // Whether there is another triangle: three comparisons. The way there: two additions, and
        // the branches out and back.
        EXPECT_EQ(cost(costs, "persistent_packet", "leaf_loop"), 7u);
        // Whether a first leaf was found: two comparisons, a branch; the branch back.
        EXPECT_EQ(cost(costs, "persistent_speculative_while_while", "node_loop"), 4u);
    }
}

TEST(DerivedCosts, AVoteOfPacketsIsOnePlace) {
    for (const auto& costs : {gt200_costs(), fermi_costs(), kepler_costs()}) {
        // The vote, and a branch on it; the first of two makes a comparison besides.
        EXPECT_LE(cost(costs, "packet", "vote"), 4u);
        EXPECT_LE(cost(costs, "persistent_packet", "vote"), 4u);
        EXPECT_GT(cost(costs, "packet", "pop"), 0u);
    }
}

TEST(DerivedCosts, OfWhatGT200LacksGoThroughSharedMemory) {
    EXPECT_GE(cost(gt200_costs(), "packet", "ballot"), 21u);
    EXPECT_GE(cost(gt200_costs(), "ray_replacement", "rank"), 21u);
    EXPECT_LE(cost(gt200_enum_popc_costs(), "packet", "ballot"), 10u);
    EXPECT_LE(cost(gt200_enum_popc_costs(), "ray_replacement", "rank"), 5u);
    // The second pipeline takes two multiplications of the edges.
    EXPECT_EQ(cost(gt200_costs(), "while_while", "test_edges") + 2,
              cost(fermi_costs(), "while_while", "test_edges"));
}

TEST(DerivedCosts, AreThereForEachKernelAndHaveARange) {
    for (const auto& costs :
         {gt200_costs(), gt200_enum_popc_costs(), fermi_costs(), kepler_costs()}) {
        EXPECT_EQ(costs.size(), warp_kernels().size() * op_count);
        for (const OperationCost& c : costs) {
            EXPECT_GE(c.most, c.instructions) << c.kernel << ", " << c.operation;
            EXPECT_FALSE(c.origin.empty());
        }
    }
}

}  // namespace
}  // namespace raydix::test
