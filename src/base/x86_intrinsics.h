// Intel's intrinsics, for functions with a target of their own. RAYDIX_X86_INTRINSICS says that
// they are there.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__)
// GCC 12 takes the undefined operands of its own intrinsics for mistakes.
#pragma GCC diagnostic push
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <immintrin.h>
#pragma GCC diagnostic pop
#define RAYDIX_X86_INTRINSICS
#endif
