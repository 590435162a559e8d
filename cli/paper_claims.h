// The claims of Aila and Laine 2009 as data: two kernels, a kind of ray, a machine, and the
// interval that the paper's words give for the ratio of the two.
#pragma once

#include <raydix/rays.h>
#include <raydix/simulate.h>

#include <algorithm>
#include <limits>

#include "ratio_error.h"

namespace raydix::cli {

struct Claim {
    const char* text;
    const char* paper;  // its own number, and how it was found
    Interval ratio;     // of `kernel` to `against`
    WarpKernel kernel, against;
    RayKind kind;
    const char *machine, *machine_against;
    Figure figure;
};

/// "About" leaves half of the gain to either side, at least 0.1 and at most 0.4.
constexpr Interval about(double ratio) {
    const double slack = std::clamp(0.5 * (ratio - 1.0), 0.1, 0.4);
    return {ratio - slack, ratio + slack};
}
constexpr Interval more{1.0, std::numeric_limits<double>::infinity()};

namespace paper_claims {
using K = WarpKernel;
using R = RayKind;
using F = Figure;

inline constexpr const char *gtx285 = "gtx285", *wished = "gtx285_enum_popc";
inline constexpr const char *per_ray = "per-ray kernels beat packets",
                            *packet_gain = "persistent warps gain about twofold for packets",
                            *while_gain = "persistent warps gain about 1.5 times for while-while",
                            *if_more = "if-if issues more instructions than while-while",
                            *if_slowest = "the slowest warps of if-if are about 30 % faster",
                            *if_same = "without persistence if-if is as fast as while-while",
                            *speculation = "speculation gains 5 to 10 %",
                            *replacement = "replacing terminated rays would gain about 20 %",
                            *queues =
                                "local work queues would gain about 40 % (ao), 80 % (diffuse)";
inline constexpr const char *twofold = "2 times, measured", *half_more = "1.5 times, measured",
                            *issued_more = "more, simulated", *slowest = "1.3 times, simulated",
                            *equal = "1 times, measured", *some = "1.05 to 1.1 times, measured",
                            *fifth = "1.2 times, predicted by the authors' simulator",
                            *queue_ao = "1.4 times, predicted by the authors' simulator, on Fairy",
                            *queue_diffuse =
                                "1.8 times, predicted by the authors' simulator, on Fairy";

inline constexpr Claim all[] = {
    {per_ray, "more, measured", more, K::persistent_while_while, K::persistent_packet, R::primary,
     gtx285, gtx285, F::bound},
    {per_ray, "more, measured", more, K::persistent_while_while, K::persistent_packet, R::ao,
     gtx285, gtx285, F::bound},
    {"per-ray kernels beat packets about twofold on diffuse rays", twofold, about(2.0),
     K::persistent_while_while, K::persistent_packet, R::diffuse, gtx285, gtx285, F::bound},
    {packet_gain, twofold, about(2.0), K::persistent_packet, K::packet, R::primary, gtx285, gtx285,
     F::scheduled},
    {packet_gain, twofold, about(2.0), K::persistent_packet, K::packet, R::ao, gtx285, gtx285,
     F::scheduled},
    {packet_gain, twofold, about(2.0), K::persistent_packet, K::packet, R::diffuse, gtx285, gtx285,
     F::scheduled},
    {while_gain, half_more, about(1.5), K::persistent_while_while, K::while_while, R::primary,
     gtx285, gtx285, F::scheduled},
    {while_gain, half_more, about(1.5), K::persistent_while_while, K::while_while, R::ao, gtx285,
     gtx285, F::scheduled},
    {while_gain, half_more, about(1.5), K::persistent_while_while, K::while_while, R::diffuse,
     gtx285, gtx285, F::scheduled},
    {if_more, issued_more, more, K::if_if, K::while_while, R::primary, gtx285, gtx285,
     F::instructions},
    {if_more, issued_more, more, K::if_if, K::while_while, R::ao, gtx285, gtx285, F::instructions},
    {if_more, issued_more, more, K::if_if, K::while_while, R::diffuse, gtx285, gtx285,
     F::instructions},
    {if_slowest, slowest, about(1.3), K::while_while, K::if_if, R::primary, gtx285, gtx285,
     F::slowest_warps},
    {if_slowest, slowest, about(1.3), K::while_while, K::if_if, R::diffuse, gtx285, gtx285,
     F::slowest_warps},
    {if_same, equal, about(1.0), K::if_if, K::while_while, R::primary, gtx285, gtx285,
     F::scheduled},
    {speculation,
     some,
     {1.05, 1.1},
     K::persistent_speculative_while_while,
     K::persistent_while_while,
     R::primary,
     gtx285,
     gtx285,
     F::bound},
    {speculation,
     some,
     {1.05, 1.1},
     K::persistent_speculative_while_while,
     K::persistent_while_while,
     R::ao,
     gtx285,
     gtx285,
     F::bound},
    {replacement, fifth, about(1.2), K::ray_replacement, K::persistent_while_while, R::ao, gtx285,
     gtx285, F::bound},
    {replacement, fifth, about(1.2), K::ray_replacement, K::persistent_while_while, R::ao, wished,
     gtx285, F::bound},
    {replacement, fifth, about(1.2), K::ray_replacement, K::persistent_while_while, R::diffuse,
     gtx285, gtx285, F::bound},
    {replacement, fifth, about(1.2), K::ray_replacement, K::persistent_while_while, R::diffuse,
     wished, gtx285, F::bound},
    {queues, queue_ao, about(1.4), K::work_queue, K::persistent_while_while, R::ao, gtx285, gtx285,
     F::bound},
    {queues, queue_ao, about(1.4), K::work_queue, K::persistent_while_while, R::ao, wished, gtx285,
     F::bound},
    {queues, queue_diffuse, about(1.8), K::work_queue, K::persistent_while_while, R::diffuse,
     gtx285, gtx285, F::bound},
    {queues, queue_diffuse, about(1.8), K::work_queue, K::persistent_while_while, R::diffuse,
     wished, gtx285, F::bound},
};
}  // namespace paper_claims

}  // namespace raydix::cli
