#include "exec/result_budget.h"

#include <gtest/gtest.h>
#include <raydix/result_limit.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "exec/parallel.h"
#include "support/message.h"

namespace raydix {
namespace {

using test::message_of;

TEST(ResultBudget, TakesExactlyItsLimit) {
    ResultBudget budget("call", 100);
    budget.take(60);
    EXPECT_TRUE(budget.try_take(40));
    EXPECT_FALSE(budget.try_take(1));
    budget.give_back(30);
    budget.take_last(30);
    EXPECT_EQ(budget.held(), 100u);
}

TEST(ResultBudget, NamesTheBytes) {
    ResultBudget budget("call", 100);
    budget.take(60);
    EXPECT_EQ(message_of([&] { budget.take_last(41); }),
              "call: the result needs 101 bytes; max_result_bytes lets it have 100");
    EXPECT_EQ(message_of([&] { budget.take_last(~std::uint64_t{0}); }),
              "call: the result needs 18446744073709551615 bytes; max_result_bytes lets it have "
              "100");
    budget.expect(100);
    EXPECT_EQ(message_of([&] { budget.expect(101); }),
              "call: the result needs more than 100 bytes; max_result_bytes lets it have 100");
    try {
        ResultBudget("call", 100).take_last(101);
        FAIL();
    } catch (const ResultTooLarge& error) {
        EXPECT_EQ(error.bytes(), 101u);
        EXPECT_TRUE(error.is_exact());
    }
}

TEST(ResultBudget, OnceRefusedAllThreadsStop) {
    ResultBudget budget("call", 100);
    budget.go_on();
    EXPECT_THROW(budget.take(101), ResultTooLarge);
    EXPECT_EQ(budget.held(), 0u);
    EXPECT_THROW(budget.go_on(), ResultTooLarge);
    EXPECT_THROW(budget.take(1), ResultTooLarge);
}

TEST(ResultBudget, VectorsChargeTheirCapacityAndWhatTheyMoveFrom) {
    ResultBudget budget("call", 1000);
    {
        BudgetVector<std::uint64_t> list{BudgetAllocator<std::uint64_t>(&budget)};
        list.reserve(40);
        EXPECT_EQ(budget.held(), 320u);
        const BudgetVector<std::uint64_t> moved = std::move(list);
        EXPECT_EQ(budget.held(), 320u);
        BudgetVector<std::uint64_t> copy = moved;  // of none
        copy.resize(85);
        EXPECT_EQ(budget.held(), 1000u);
        EXPECT_THROW(copy.push_back(1), ResultTooLarge);  // needs more beside the 680
        EXPECT_EQ(copy.size(), 85u);
        EXPECT_EQ(budget.held(), 1000u);
    }
    EXPECT_EQ(budget.held(), 0u);
}

TEST(ResultBudget, PackingGivesUnusedRoomBack) {
    ResultBudget budget("call", 1000);
    BudgetVector<std::uint64_t> list{BudgetAllocator<std::uint64_t>(&budget)};
    list.reserve(64);
    list.assign({1, 2, 3});
    pack(list);
    EXPECT_EQ(budget.held(), 24u);
    EXPECT_EQ(list.size(), 3u);
    EXPECT_EQ(list[2], 3u);
}

TEST(ResultBudget, SharesCountInTheWholeAndDoNotStopIt) {
    ResultBudget budget("call", 100);
    {
        ResultBudget share(budget, 2);
        share.take(30);
        EXPECT_EQ(budget.held(), 60u);
        EXPECT_THROW(share.take(21), ResultTooLarge);
        EXPECT_THROW(share.go_on(), ResultTooLarge);
        budget.go_on();
        budget.take(40);
        share.count_once();
        EXPECT_EQ(budget.held(), 70u);
        share.give_back(30);
    }
    EXPECT_EQ(budget.held(), 40u);
}

TEST(ResultBudget, RefusesFromWithinLoopsOfAnyNumberOfThreads) {
    for (const int threads : {1, 2, 7}) {
        ResultBudget budget("call", 1 << 20);
        EXPECT_THROW(with_threads(threads,
                                  [&] {
                                      auto lists = budget_lists<std::uint32_t>(256, budget);
                                      for_each_index(
                                          lists.size(),
                                          [&](std::size_t i) {
                                              for (std::uint32_t k = 0; k < 100'000; ++k)
                                                  lists[i].push_back(k);
                                          },
                                          1);
                                  }),
                     ResultTooLarge);
        EXPECT_EQ(budget.held(), 0u) << threads;
    }
}

TEST(ResultBudget, WithoutALimitItIsHalfOfWhatIsLeft) {
    const std::uint64_t left = available_memory();
    ASSERT_NE(left, unknown_memory);
    EXPECT_NEAR(static_cast<double>(usual_result_bytes()), static_cast<double>(left) / 2,
                static_cast<double>(left) / 4);
    require_result_bytes("call", left / 8, 0);
    EXPECT_THROW(require_result_bytes("call", left, 0), ResultTooLarge);
    EXPECT_THROW(require_result_bytes("call", unknown_memory, 0), ResultTooLarge);
    require_result_bytes("call", left, left);
}

/// Folders and files as a system has them.
class FakeSystem : public testing::Test {
protected:
    void SetUp() override {
        root_ = std::filesystem::path(testing::TempDir()) /
                ("raydix_" +
                 std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
        std::filesystem::remove_all(root_);
    }
    void TearDown() override { std::filesystem::remove_all(root_); }
    void write(const std::string& name, const std::string& text) {
        std::filesystem::create_directories((root_ / name).parent_path());
        std::ofstream(root_ / name) << text;
    }
    std::uint64_t group_left() { return group_memory_left(root_ / "cgroup", root_ / "mount"); }

    std::filesystem::path root_;
};

TEST_F(FakeSystem, TellsWhatIsLeftInKilobytes) {
    write("meminfo", "MemTotal:       2000 kB\nMemFree:   7 kB\nMemAvailable:    1500 kB\n");
    EXPECT_EQ(system_memory_left(root_ / "meminfo"), 1500u * 1024);
    EXPECT_EQ(system_memory_left(root_ / "no such file"), unknown_memory);
}

TEST_F(FakeSystem, SecondVersionOfGroups) {
    write("cgroup", "0::/slice/unit\n");
    EXPECT_EQ(group_left(), unknown_memory);
    write("mount/slice/unit/memory.max", "max\n");
    EXPECT_EQ(group_left(), unknown_memory);
    write("mount/slice/memory.max", "1000000\n");
    EXPECT_EQ(group_left(), 1000000u);
    write("mount/slice/memory.current", "600000\n");
    EXPECT_EQ(group_left(), 400000u);
    write("mount/slice/memory.stat", "anon 5\ninactive_file 200000\nactive_file 100000\n");
    EXPECT_EQ(group_left(), 700000u);
    write("mount/slice/unit/memory.max", "300000\n");  // the least of all levels
    EXPECT_EQ(group_left(), 300000u);
    write("mount/slice/unit/memory.current", "300001\n");
    EXPECT_EQ(group_left(), 0u);
}

TEST_F(FakeSystem, FirstVersionOfGroups) {
    write("cgroup", "12:pids:/x\n4:cpu,memory:/docker/abc\n3:memoryless:/y\n0::/\n");
    write("mount/memory/memory.limit_in_bytes", "9223372036854771712\n");
    EXPECT_GT(group_left(), std::uint64_t{1} << 60);
    write("mount/memory/docker/abc/memory.limit_in_bytes", "800\n");
    write("mount/memory/docker/abc/memory.usage_in_bytes", "500\n");
    write("mount/memory/docker/abc/memory.stat", "total_inactive_file 40\ntotal_active_file 60\n");
    EXPECT_EQ(group_left(), 400u);
    // Seen from within a container its own group is the root.
    write("cgroup", "4:memory:/docker/not/here\n");
    write("mount/memory/memory.limit_in_bytes", "600\n");
    EXPECT_EQ(group_left(), 600u);
}

TEST_F(FakeSystem, WithoutGroupsNothingIsKnown) { EXPECT_EQ(group_left(), unknown_memory); }

}  // namespace
}  // namespace raydix
