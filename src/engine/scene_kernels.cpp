// Compiles the walk through scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/hit_order.h"
#include "engine/scene_job.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scene_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/scene_calls.h"
#include "engine/scene_walk.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

inline void trace_scene(SceneJob& job) {
    if (job.any)
        SceneWalk<true>(job).run();
    else
        SceneWalk<false>(job).run();
}

/// All hits of the rays of a job. One after the other if they go alone, have a filter, or their
/// numbers have no room beside those of paths.
inline void all_scene_hits(SceneJob& job) {
    if (job.single || job.filter != nullptr || !HitsOfJob::has_room(job)) {
        all_hits_one_by_one(job);
        return;
    }
    HitsOfJob hits(job);
    SceneWalk<false>(job, &hits).run();
    hits.put_in_order();
}

SceneKernels scene_kernels(std::string_view isa) {
    return {isa,
            trace_scene,
            all_scene_hits,
            count_scene_steps,
            hit_of_scene<false>,
            hit_of_scene<true>};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "trace/simd/kernels_by_set.h"

namespace raydix {

const SceneKernels& scene_kernels_for(std::string_view isa) {
    static const KernelsBySet<SceneKernels> all(RAYDIX_OF_EACH_SET(scene_kernels));
    return all.named(isa);
}

}  // namespace raydix
#endif
