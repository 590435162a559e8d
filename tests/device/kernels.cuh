// The per-element functions of the core as CUDA kernels, one thread per element, with plain names.
#pragma once

#include "device/work.h"

// The kernels: NAME(work, n) calls work(i) for i in [0, n).
#define RAYDIX_DEVICE_KERNELS(X)                                                              \
    X(encode_triangles_30,                                                                    \
      raydix::EncodeMorton<raydix::TriangleSource RAYDIX_COMMA std::uint32_t>)                \
    X(encode_triangles_63,                                                                    \
      raydix::EncodeMorton<raydix::TriangleSource RAYDIX_COMMA std::uint64_t>)                \
    X(encode_boxes_63, raydix::EncodeMorton<raydix::BoxSource RAYDIX_COMMA std::uint64_t>)    \
    X(encode_points_63, raydix::EncodeMorton<raydix::PointSource RAYDIX_COMMA std::uint64_t>) \
    X(find_range_30, raydix::device_test::FindRange<std::uint32_t>)                           \
    X(find_range_63, raydix::device_test::FindRange<std::uint64_t>)                           \
    X(emit_radix_node, raydix::device_test::EmitFromRange)                                    \
    X(fit_boxes, raydix::device_test::FitTriangles)                                           \
    X(answer_ray, raydix::device_test::AnswerRay)
#define RAYDIX_COMMA ,

#define RAYDIX_DECLARE_KERNEL(name, ...) __global__ void name(__VA_ARGS__ work, std::uint32_t n);
RAYDIX_DEVICE_KERNELS(RAYDIX_DECLARE_KERNEL)
