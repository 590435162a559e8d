// Compiles the queries once per instruction set (Highway's foreach_target) and lists those that
// this processor can run.
#include "points/point_kernels.h"

#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "points/point_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/baseline_isa.h"
#include "points/nearest.h"
#include "points/range_query.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

template <class T, int Dim>
PointKernels<T, Dim> kernels(std::string_view isa) {
    return {isa,
            nearest<T, Dim>,
            count_within<Ball<T, Dim>, T, Dim>,
            count_within<Window<T, Dim>, T, Dim>,
            collect_within<Ball<T, Dim>, T, Dim>,
            collect_within<Window<T, Dim>, T, Dim>,
            fill_within<Ball<T, Dim>, T, Dim>,
            fill_within<Window<T, Dim>, T, Dim>,
            visit_ball<T, Dim>};
}

// Named here, so that they are compiled for this instruction set and no other.
PointKernels<float, 2> kernels_f2(std::string_view isa) { return kernels<float, 2>(isa); }
PointKernels<float, 3> kernels_f3(std::string_view isa) { return kernels<float, 3>(isa); }
PointKernels<double, 2> kernels_d2(std::string_view isa) { return kernels<double, 2>(isa); }
PointKernels<double, 3> kernels_d3(std::string_view isa) { return kernels<double, 3>(isa); }

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

#if RAYDIX_CHOOSES_AVX512
#define RAYDIX_ADD_AVX3(name) \
    if (here & HWY_AVX3) found.push_back(N_AVX3::name("avx512"));
#else
#define RAYDIX_ADD_AVX3(name)
#endif
#if RAYDIX_CHOOSES_AVX2
#define RAYDIX_ADD_AVX2(name) \
    if (here & HWY_AVX2) found.push_back(N_AVX2::name("avx2"));
#else
#define RAYDIX_ADD_AVX2(name)
#endif
#define RAYDIX_POINT_KERNELS(T, Dim, name)                                       \
    template <>                                                                  \
    std::span<const PointKernels<T, Dim>> point_kernels<T, Dim>() {              \
        static const std::vector<PointKernels<T, Dim>> all = [] {                \
            std::vector<PointKernels<T, Dim>> found;                             \
            [[maybe_unused]] const std::int64_t here = hwy::SupportedTargets();  \
            RAYDIX_ADD_AVX3(name)                                                \
            RAYDIX_ADD_AVX2(name)                                                \
            found.push_back(HWY_STATIC_DISPATCH(name)(runnable_baseline(here))); \
            return found;                                                        \
        }();                                                                     \
        return all;                                                              \
    }
RAYDIX_POINT_KERNELS(float, 2, kernels_f2)
RAYDIX_POINT_KERNELS(float, 3, kernels_f3)
RAYDIX_POINT_KERNELS(double, 2, kernels_d2)
RAYDIX_POINT_KERNELS(double, 3, kernels_d3)

}  // namespace raydix
#endif
