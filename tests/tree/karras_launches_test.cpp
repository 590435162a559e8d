// Karras 2012 as launches: the talk's example, and ranges against a recursion.
#include "tree/karras_launches.h"

#include <gtest/gtest.h>

#include "support/launched_tree.h"

namespace raydix::test {
namespace {

const auto run_karras = [](auto& tree) {
    HostLauncher<> launcher;
    launch_karras(launcher, tree.in, tree.template scratch<KarrasScratch>(tree.in.count),
                  tree.links());
};

template <class Key>
void expect_karras_talk() {
    const std::vector<Key> keys = talk_keys<Key>();
    LaunchedTree<Key> tree(keys, 1);
    run_karras(tree);
    EXPECT_EQ(tree.ranges(), talk_ranges());
    // One leaf a key, so ranks are the radix nodes of the paper: (0, 1) is node 1, (0, 3) is
    // node 3.
    EXPECT_EQ(tree.nodes[pair_slot(0)].first, pair_slot(3));
    EXPECT_EQ(tree.nodes[pair_slot(3)].first, pair_slot(1));
}

TEST(KarrasLaunches, WorkedExample) {
    expect_karras_talk<std::uint32_t>();
    expect_karras_talk<std::uint64_t>();
}

TEST(KarrasLaunches, RangesAreThoseOfTheRecursion) {
    expect_reference_ranges<std::uint32_t>(run_karras);
    expect_reference_ranges<std::uint64_t>(run_karras);
}

}  // namespace
}  // namespace raydix::test
