// Limits on threads: what is refused, who works, and that calls with different limits may meet.
// Loops inside of loops, and exceptions.
#include "exec/parallel.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <atomic>
#include <cstdint>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/float_env.h"
#include "support/message.h"

namespace raydix {
namespace {

TEST(WithThreads, RefusesWhatNoMachineHas) {
    const auto told = [](int threads) {
        bool ran = false;
        const std::string message =
            test::message_of([&] { with_threads(threads, [&] { ran = true; }); });
        EXPECT_EQ(ran, message == "no error") << threads;
        return message;
    };
    const auto refusal = [](const std::string& number) {
        return "option threads is " + number +
               "; it must be 0 to 1024, where 0 is all the machine has";
    };
    EXPECT_EQ(told(-1), refusal("-1"));
    EXPECT_EQ(told(1025), refusal("1025"));
    EXPECT_EQ(told(100000), refusal("100000"));
    EXPECT_EQ(told(-2147483647 - 1), refusal("-2147483648"));
    for (const int threads : {0, 1, 2, 1024}) EXPECT_EQ(told(threads), "no error");
}

/// A sum whose loops within loops keep all threads of the limit busy.
std::uint64_t work() {
    std::atomic<std::uint64_t> sum{0};
    for_each_index(
        64,
        [&](std::size_t i) {
            for_each_index(
                100, [&](std::size_t k) { sum += i * k; }, 10);
        },
        1);
    return sum;
}
constexpr std::uint64_t work_sum = (63 * 64 / 2) * (99 * 100 / 2);

TEST(WithThreads, OneIsTheCaller) {
    std::mutex lock;
    std::set<std::thread::id> seen;
    for (int round = 0; round < 20; ++round)
        with_threads(1, [&] {
            EXPECT_EQ(thread_count(), 1);
            for_each_index(
                1000,
                [&](std::size_t) {
                    const std::scoped_lock held(lock);
                    seen.insert(std::this_thread::get_id());
                },
                1);
        });
    EXPECT_EQ(seen, std::set<std::thread::id>{std::this_thread::get_id()});
}

TEST(WithThreads, AtMostAsManyAsAsked) {
    for (const int threads : {2, 3, 7}) {
        std::atomic<int> now{0}, most{0};
        with_threads(threads, [&] {
            for_each_index(
                200,
                [&](std::size_t) {
                    const int here = ++now;
                    for (int before = most; here > before;)
                        if (most.compare_exchange_weak(before, here)) break;
                    std::this_thread::yield();
                    --now;
                },
                1);
        });
        EXPECT_LE(most, threads);
    }
}

TEST(WithThreads, DifferentLimitsMeetInSilence) {
    std::atomic<int> wrong{0};
    ::testing::internal::CaptureStderr();
    {
        std::vector<std::thread> callers;
        for (const int threads : {1, 2, 3, 7, 64, 1024, 0, 5})
            callers.emplace_back([threads, &wrong] {
                for (int round = 0; round < 20; ++round) {
                    std::uint64_t sum = 0;
                    with_threads(threads, [&] {
                        with_threads(round % 4, [&] { sum = work(); });
                        sum += work();
                    });
                    wrong += sum != 2 * work_sum;
                }
            });
        for (std::thread& caller : callers) caller.join();
    }
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(wrong, 0);
}

#if defined(__SSE2__)
TEST(WithThreads, ArithmeticIsPlainOnEveryThread) {
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040u);  // FTZ, DAZ: what another library may have left behind
    for (const int threads : {0, 1, 2, 7}) {
        std::atomic<int> flushed{0};
        with_threads(threads, [&] {
            for_each_index(
                2000, [&](std::size_t) { flushed += !FloatEnvironment::is_plain(); }, 1);
        });
        EXPECT_EQ(flushed, 0) << threads;
    }
    const unsigned after = _mm_getcsr();
    _mm_setcsr(before);
    EXPECT_EQ(after & 0x8040u, 0x8040u) << "the caller's own stays";
}
#endif

TEST(Loops, GoOnInsideOfOneThatEndsByAnException) {
    struct Enough {};
    constexpr std::size_t outer = 8, inner = 20'000;
    std::atomic<std::size_t> unfinished = 0, complete = 0;
    for (int round = 0; round < 50; ++round) {
        std::atomic<std::size_t> begun = 0;
        const auto loops = [&](std::size_t k) {
            ++begun;
            if (k == 0) {  // let another one begin, if there is a thread for it
                for (int wait = 0; wait < 1000 && begun < 2; ++wait) std::this_thread::yield();
                throw Enough{};
            }
            std::atomic<std::size_t> done = 0;
            for_each_index(
                inner, [&](std::size_t) { ++done; }, 16);
            ++(done == inner ? complete : unfinished);
        };
        EXPECT_THROW(with_threads(2, [&] { for_each_index(outer, loops, 1); }), Enough);
    }
    EXPECT_EQ(unfinished, 0u);
    EXPECT_TRUE(complete > 0 || thread_count() == 1);
}

TEST(WithThreads, ExceptionsComeOut) {
    for (const int threads : {0, 1, 7})
        EXPECT_EQ(test::message_of([&] {
                      with_threads(threads, [] {
                          for_each_index(
                              100,
                              [](std::size_t i) {
                                  if (i == 50) throw InputError("mine");
                              },
                              1);
                      });
                  }),
                  "mine");
}

}  // namespace
}  // namespace raydix
