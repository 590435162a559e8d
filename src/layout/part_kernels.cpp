// Compiles the writing of sorted parts once per instruction set.
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <numeric>
#include <span>
#include <vector>

#include "base/float3.h"
#include "layout/about_middle.h"
#include "layout/leaf_order.h"
#include "layout/node_slots.h"
#include "layout/sorted_part.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "layout/part_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/baseline_isa.h"
#include "layout/sorted_part_writer.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

template <int width>
void write_parts(const PartInput& in, const PartGroup& group, PartEntries<width>& entries,
                 WidePart& out) {
    SortedPartWriter<width>(in, group, entries, out).run();
}

PartKernel part_kernel(std::string_view isa) { return {isa, write_parts<4>, write_parts<8>}; }

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

std::span<const PartKernel> part_kernels() {
    static const std::vector<PartKernel> all = [] {
        std::vector<PartKernel> found;
        [[maybe_unused]] const std::int64_t here = hwy::SupportedTargets();
#if RAYDIX_CHOOSES_AVX512
        if (here & HWY_AVX3) found.push_back(N_AVX3::part_kernel("avx512"));
#endif
#if RAYDIX_CHOOSES_AVX2
        if (here & HWY_AVX2) found.push_back(N_AVX2::part_kernel("avx2"));
#endif
        found.push_back(HWY_STATIC_DISPATCH(part_kernel)(runnable_baseline(here)));
        return found;
    }();
    return all;
}

}  // namespace raydix
#endif
