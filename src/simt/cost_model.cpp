// The counts, operation by operation.
#include "simt/cost_model.h"

#include <algorithm>

namespace raydix {
namespace {

/// Replaces or adds costs.
std::vector<OperationCost> changed(std::vector<OperationCost> table,
                                   const std::vector<OperationCost>& changes) {
    for (const OperationCost& change : changes) {
        const auto at = std::find_if(table.begin(), table.end(), [&](const OperationCost& c) {
            return c.operation == change.operation;
        });
        if (at == table.end())
            table.push_back(change);
        else
            *at = change;
    }
    return table;
}

}  // namespace

std::vector<OperationCost> gt200_costs() {
    return {
        {"main_loop", 2, "comparison, branch"},
        {"node_loop", 2, "comparison, branch"},
        {"leaf_loop", 2, "comparison, branch"},
        {"visit_node", 52,
         "address 1, four loads 4; 12 multiply-adds; per child 12 minima and maxima of planes, "
         "nearest and farthest: 24; hit 2, closer 1; both, any 2; four selects 4; two branches 2"},
        {"push", 3, "address, store, increment"},
        {"pop", 4, "comparison with the empty stack, decrement, address, load"},
        {"test_triangle", 14,
         "address 1, load 1; height 3, slope 3; reciprocal and product 2; range 2; branch 1; "
         "reload guard 1"},
        {"test_edges", 22,
         "two loads 2; per edge start 3, slope 3, sum 1: 14; two signs 2, sum and comparison 2; "
         "joined 1, branch 1"},
        {"accept_hit", 8, "id and its mask 2; t and tie 2; t, u, v, prim 4"},
        {"next_triangle", 5, "load of the id 1, its mark 1, next link 1, select 1, branch 1"},
        {"postpone_leaf", 3, "leaf, none aside 2; move 1"},
        {"next_leaf", 3, "comparison 2; move 1"},
        {"vote", 3, "comparison, vote, branch"},
        {"ballot", 22, "comparison 1; five steps of load, add, store, select 20; result 1"},
        {"rank", 21, "five steps of load, add, store, select 20; result 1"},
        {"shuffle", 2, "store to and load from shared memory"},
        {"choose", 4, "two comparisons, two selects"},
        {"take_rays", 4, "first lane's comparison and branch 2; address 1, atomic addition 1"},
        {"start_ray", 27,
         "address 1, two loads 2; per component magnitude, comparison, select, reciprocal, "
         "product 15; range 2; seven values set 7"},
        {"store_hit", 6, "address 2, conversion of a miss 2, store 1, mark 1"},
        {"exchange_ray", 45,
         "address 3; a load and a store for each of 21 words: origin, direction, inverse, scaled "
         "12, tmin, t, u, v, prim, ray, node, top, stack 9"},
    };
}

std::vector<OperationCost> gt200_enum_popc_costs() {
    return changed(gt200_costs(), {{"ballot", 2, "comparison, POPC as wished for in the paper"},
                                   {"rank", 1, "ENUM as wished for in the paper"}});
}

std::vector<OperationCost> fermi_costs() {
    return changed(gt200_costs(), {{"ballot", 3, "comparison, ballot, population count"},
                                   {"rank", 2, "mask of lower lanes and, population count"}});
}

std::vector<OperationCost> kepler_costs() {
    return changed(
        fermi_costs(),
        {{"visit_node", 44,
          "as Fermi, but per child 8 instead of 12 minima and maxima: the pairs that end the "
          "chains take three operands"},
         {"shuffle", 1, "shuffle"}});
}

}  // namespace raydix
