// Leaks of the library and of the tests apart from those of the MPI library, under the address
// sanitizer; nothing in other builds.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
#define RAYDIX_FINDS_LEAKS 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define RAYDIX_FINDS_LEAKS 1
#endif
#endif
#ifdef RAYDIX_FINDS_LEAKS
#include <sanitizer/lsan_interface.h>
#endif

namespace raydix::mpi::test {

/// What is allocated while one exists may stay. MPI_Init unloads parts of the MPI library that it
/// does not take, so leaks.txt could not name them.
struct MayLeak {
#ifdef RAYDIX_FINDS_LEAKS
    MayLeak() { __lsan_disable(); }
    ~MayLeak() { __lsan_enable(); }
#else
    MayLeak() {}  // not trivial: such an object would be an unused variable
#endif
    MayLeak(const MayLeak&) = delete;
    MayLeak& operator=(const MayLeak&) = delete;
};

/// Ends the process with an error if anything has leaked; none is looked for after that, because
/// MPI_Finalize unloads the rest.
inline void require_no_leaks() {
#ifdef RAYDIX_FINDS_LEAKS
    __lsan_do_leak_check();
#endif
}

}  // namespace raydix::mpi::test
