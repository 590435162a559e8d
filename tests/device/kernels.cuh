// The per-element functions of the core as CUDA kernels, one thread per element, with plain names.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>

#include "keys/morton.h"
#include "layout/leaf_order.h"
#include "primitives/sources.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"
#include "tree/fit.h"
#include "tree/radix_tree.h"

namespace raydix::device_test {

/// What closest and half-open tests say of a ray against all triangles, and its interval in their
/// box.
struct RayAnswer {
    Hit closest;              // t in the caller's units
    std::uint32_t crossings;  // half-open hits
    SlabInterval box;         // of the padded box around all triangles
};

/// Ray -> answer by testing every triangle. rays [n] -> answers [n].
struct AnswerRay {
    const Ray* rays;
    const LeafTriangle* triangles;
    std::uint32_t triangle_count;
    BvhNode root;
    RayAnswer* answers;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        RayAnswer answer{Hit{}, 0, {0.0f, 0.0f}};
        if (is_valid(rays[i])) {
            const RayFrame frame = make_frame(rays[i]);
            answer.box = intersect_slabs(make_slab_frame(frame, {root.lo, root.hi}), &root.lo.x,
                                         frame.tmin, frame.tmax);
            float reach = frame.tmax;
            for (std::uint32_t k = 0; k < triangle_count; ++k) {
                TriangleHit hit;
                if (intersect_triangle<EdgeRule::half_open>(frame, triangles[k], frame.tmax, hit))
                    ++answer.crossings;
                if (!intersect_triangle<EdgeRule::closed>(frame, triangles[k], reach, hit))
                    continue;
                if (hit.t < reach || !answer.closest.hit())
                    answer.closest = {hit.t * frame.t_scale, k, hit.u, hit.v};
                reach = hit.t;
            }
        }
        answers[i] = answer;
    }
};

/// Node -> its range of keys. keys [n] -> ranges [n - 1].
template <class Key>
struct FindRange {
    SortedKeys<Key> keys;
    RadixRange* ranges;
    RAYDIX_HD void operator()(std::uint32_t i) const { ranges[i] = find_range(keys, i); }
};

/// Range -> links of a node and its children.
struct EmitFromRange {
    EmitRadixNode emit;
    const RadixRange* ranges;
    RAYDIX_HD void operator()(std::uint32_t i) const { emit(i, ranges[i]); }
};

using FitTriangles = FitBoxes<LeafBoxOf<LeafTriangle>>;

}  // namespace raydix::device_test

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
