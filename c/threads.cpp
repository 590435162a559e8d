// The caller's thread pool, handed over through C.
#include "inside.h"

using raydix_c::guarded;

extern "C" {

raydix_status raydix_use_thread_pool(const raydix_thread_pool* pool) {
    return guarded([&] {
        if (pool == nullptr) {
            raydix::use_thread_pool({});
            return;
        }
        raydix_c::require(reinterpret_cast<const void*>(pool->workers), "pool->workers");
        raydix_c::require(reinterpret_cast<const void*>(pool->run), "pool->run");
        using Job = std::function<void(std::size_t)>;
        const auto call = [](void* data, std::size_t number) {
            (*static_cast<const Job*>(data))(number);
        };
        raydix::use_thread_pool({.workers = [given = *pool] { return given.workers(given.user); },
                                 .run =
                                     [given = *pool, call](std::size_t jobs, const Job& job) {
                                         given.run(given.user, jobs, call, const_cast<Job*>(&job));
                                     }});
    });
}

}  // extern "C"
