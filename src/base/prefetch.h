// How functions that only prefetch are declared.
#pragma once

/// GCC (12 at least) takes a function that does nothing but prefetch for one without effect and
/// removes its calls, unless it was inlined before.
#if defined(__GNUC__)
#define RAYDIX_PREFETCHING [[gnu::always_inline]] inline
#else
#define RAYDIX_PREFETCHING inline
#endif
