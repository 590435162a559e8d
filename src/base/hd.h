// RAYDIX_HD marks functions that run on the host and on a device; RAYDIX_RARE those of them that
// are seldom called and shall not make their callers larger; RAYDIX_INLINE those that must never be
// a call. RAYDIX_DEVICE_COMPILER: the compiler knows device code, nvcc for CUDA or clang for OpenCL
// and HIP. RAYDIX_DEVICE_PASS: what is compiled now is for the device.
#pragma once

#if defined(__CUDACC__)
#define RAYDIX_HD __host__ __device__
#define RAYDIX_RARE __host__ __device__ inline
#define RAYDIX_INLINE __host__ __device__ __forceinline__
#define RAYDIX_DEVICE_COMPILER 1
#elif defined(__HIP__)
#define RAYDIX_HD __attribute__((host)) __attribute__((device))
#define RAYDIX_RARE __attribute__((host)) __attribute__((device)) inline
#define RAYDIX_INLINE \
    __attribute__((host)) __attribute__((device)) __attribute__((always_inline)) inline
#define RAYDIX_DEVICE_COMPILER 1
#else
#define RAYDIX_HD
#define RAYDIX_RARE [[gnu::noinline, gnu::cold]] inline
#define RAYDIX_INLINE [[gnu::always_inline]] inline
#endif

#if defined(__CUDA_ARCH__) || defined(__HIP_DEVICE_COMPILE__)
#define RAYDIX_DEVICE_PASS 1
#endif
