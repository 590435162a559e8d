// Compiles queries of distance and overlap on scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/near_job.h"
#include "engine/near_shapes.h"
#include "primitives/exact_overlap.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/near_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/near_walk.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

NearKernels near_kernels(std::string_view isa) {
    return {isa, closest_in_scene, sphere_touches_scene, segment_touches_scene, sweep_scene};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "trace/simd/kernels_by_set.h"

namespace raydix {

const NearKernels& near_kernels_for(std::string_view isa) {
    static const KernelsBySet<NearKernels> all(RAYDIX_OF_EACH_SET(near_kernels));
    return all.named(isa);
}

}  // namespace raydix
#endif
