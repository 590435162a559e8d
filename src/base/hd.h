// RAYDIX_HD marks functions that run on the host and on a device; RAYDIX_RARE those of them that
// are seldom called and shall not make their callers larger.
#pragma once

#if defined(__CUDACC__) || defined(__HIP__)
#define RAYDIX_HD __host__ __device__
#define RAYDIX_RARE __host__ __device__ inline
#else
#define RAYDIX_HD
#define RAYDIX_RARE [[gnu::noinline, gnu::cold]] inline
#endif
