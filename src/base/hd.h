// RAYDIX_HD marks functions that run on the host and on a CUDA device.
#pragma once

#if defined(__CUDACC__)
#define RAYDIX_HD __host__ __device__
#else
#define RAYDIX_HD
#endif
