// What the kernels of kernels.cuh do per element, from the core's host and device functions alone.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>

#include "keys/morton.h"
#include "primitives/sources.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"
#include "tree/fit.h"
#include "tree/radix_tree.h"

namespace raydix::device_test {

/// What closest and half-open tests say of a ray against all triangles, and its interval in their
/// box.
struct RayAnswer {
    TreeHit closest;          // t in the caller's units
    std::uint32_t crossings;  // half-open hits
    SlabInterval box;         // of the padded box around all triangles
};

/// Ray -> answer by testing every triangle. rays [n] -> answers [n].
struct AnswerRay {
    const Ray* rays;
    const LeafTriangle* triangles;
    std::uint32_t triangle_count;
    const BvhNode* root;  // [1], the box around all triangles
    RayAnswer* answers;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        RayAnswer answer{TreeHit{}, 0, {0.0f, 0.0f}};
        if (is_valid(rays[i])) {
            const RayFrame frame = make_frame(rays[i]);
            answer.box = intersect_slabs(make_slab_frame(frame, {root->lo, root->hi}), &root->lo.x,
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
    EmitRadixNode<> emit;
    const RadixRange* ranges;
    RAYDIX_HD void operator()(std::uint32_t i) const { emit(i, ranges[i]); }
};

/// As LeafBoxOf (layout/leaf_order.h), which is the host's.
struct LeafBox {
    const LeafTriangle* copies;
    RAYDIX_HD Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = empty_box();
        for (std::uint32_t k = first; k < first + count; ++k)
            box = unite(box, box_of(copies[k].v0, copies[k].v1, copies[k].v2));
        return box;
    }
};
using FitTriangles = FitBoxes<LeafBox>;

}  // namespace raydix::device_test
