// Compiles the walk of rays in double through scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/hit_order.h"
#include "engine/scene_job_double.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scene_kernels_double.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/scene_walk_double.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

SceneKernelsD scene_kernels_double(std::string_view isa) {
    return {isa, trace_scene, all_scene_hits, hit_of_scene<false>, hit_of_scene<true>};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "trace/simd/kernels_by_set.h"

namespace raydix {

const SceneKernelsD& scene_kernels_double_for(std::string_view isa) {
    static const KernelsBySet<SceneKernelsD> all(RAYDIX_OF_EACH_SET(scene_kernels_double));
    return all.named(isa);
}

}  // namespace raydix
#endif
