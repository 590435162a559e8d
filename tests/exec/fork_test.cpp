// A process that is forked off while others are at work goes on alone.
#include <gtest/gtest.h>
#include <raydix/scene_queries.h>
#include <raydix/thread_pool.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <thread>
#include <vector>

#include "exec/parallel.h"
#include "support/double_scenes.h"
#include "support/sanitized.h"

namespace raydix::test {
namespace {

/// The child's own end, or that of its alarm clock where it waits for a lock that nobody holds.
template <class Work>
int end_of_child(const Work& work) {
    const pid_t child = fork();
    if (child == 0) {
        alarm(60);
        _exit(work() ? 0 : 1);
    }
    int end = -1;
    waitpid(child, &end, 0);
    return end;
}

bool loops_count_to_a_million() {
    std::atomic<int> count{0};
    with_threads(0, [&] {
        for_each_range(1'000'000, 1000, [&](std::size_t begin, std::size_t end) {
            count += static_cast<int>(end - begin);
        });
    });
    return count == 1'000'000;
}

TEST(Fork, AChildHasOneThreadAndItsLoopsEnd) {
#ifdef __SANITIZE_THREAD__
    GTEST_SKIP() << "the sanitizer may stop forked processes; std_threads.Fork has the same loops";
#endif
    ASSERT_TRUE(loops_count_to_a_million());
    EXPECT_EQ(end_of_child([] {
                  bool inside = false;
                  with_threads(3, [&] { isolated([&] { inside = thread_count() == 1; }); });
                  return inside && thread_count() == 1 && loops_count_to_a_million();
              }),
              0);
    EXPECT_TRUE(loops_count_to_a_million());
}

TEST(Fork, WhileOtherThreadsEnterAndLeaveLoops) {
#ifdef __SANITIZE_THREAD__
    GTEST_SKIP() << "the sanitizer may stop forked processes; std_threads.Fork has the same loops";
#endif
    std::atomic<bool> done{false};
    constexpr int asker_count = 4;
    std::atomic<int> under_way{0};
    std::vector<std::thread> askers;
    for (int k = 0; k < asker_count; ++k)
        askers.emplace_back([&] {
            for (bool first = true; !done; first = false) {
                std::atomic<int> count{0};
                with_threads(
                    2, [&] { for_each_range(64, 1, [&](std::size_t, std::size_t) { ++count; }); });
                if (first) ++under_way;
            }
        });
    // A child that was forked off before the first loop makes threads of its own. The address
    // sanitizer has locks there which a thread that just starts may hold.
    while (under_way < asker_count) std::this_thread::yield();
    for (int k = 0; k < 60; ++k) ASSERT_EQ(end_of_child(loops_count_to_a_million), 0) << k;
    done = true;
    for (std::thread& asker : askers) asker.join();
}

/// What queries of distance keep of a scene in double is made by the first of them.
TEST(Fork, WhileTheFirstDistanceToASceneInDoubleIsAsked) {
    if (sanitized)
        GTEST_SKIP() << "glibc's memory and pthread_once know of fork, those of sanitizers do not";
    const MeshD mesh = random_soup_d(60'000, 4, 0.1);
    for (int k = 0; k < 4; ++k) {
        SceneD scene;
        scene.add(mesh);
        scene.commit();
        std::atomic<bool> begins{false};
        std::thread asker([&] {
            begins = true;
            static_cast<void>(closest_point(scene, {0.5, 0.5, 0.5}));
        });
        while (!begins) std::this_thread::yield();
        usleep(2000);
        EXPECT_EQ(end_of_child([&] {
                      return closest_point(scene, {0.5, 0.5, 0.5}).prim != no_primitive;
                  }),
                  0);
        asker.join();
    }
}

}  // namespace
}  // namespace raydix::test
