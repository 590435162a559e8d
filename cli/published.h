// Rates that the authors measured, Mrays/s: Aila and Laine 2009 (GTX 285) and their addendum of
// 2012 (GTX 480, GTX 680), for primary, ambient occlusion and diffuse rays.
#pragma once

#include <array>
#include <string_view>

namespace raydix::cli {

struct PublishedRates {
    std::string_view scene, kernel, machine;
    std::array<double, 3> mrays_per_s;  // primary, ao, diffuse
};

inline constexpr std::array published_rates{
    PublishedRates{"conference", "persistent_packet", "gtx285", {122.1, 86.1, 32.3}},
    PublishedRates{"conference", "persistent_while_while", "gtx285", {135.6, 130.7, 62.4}},
    PublishedRates{
        "conference", "persistent_speculative_while_while", "gtx285", {142.2, 134.5, 60.9}},
    PublishedRates{"conference", "speculative_while_while", "gtx480", {272.1, 284.1, 126.1}},
    PublishedRates{"conference", "dynamic_fetch", "gtx680", {432.6, 518.2, 245.4}},
    PublishedRates{"fairy", "persistent_packet", "gtx285", {67.2, 65.6, 21.5}},
    PublishedRates{"fairy", "persistent_while_while", "gtx285", {70.5, 85.3, 39.1}},
    PublishedRates{"fairy", "persistent_speculative_while_while", "gtx285", {74.6, 92.5, 40.8}},
    PublishedRates{"fairy", "speculative_while_while", "gtx480", {154.6, 163.6, 73.2}},
    PublishedRates{"fairy", "dynamic_fetch", "gtx680", {250.8, 317.6, 156.6}},
    PublishedRates{"sibenik", "persistent_packet", "gtx285", {100.6, 83.7, 27.3}},
    PublishedRates{"sibenik", "persistent_while_while", "gtx285", {117.5, 113.4, 48.1}},
    PublishedRates{"sibenik", "persistent_speculative_while_while", "gtx285", {117.5, 119.6, 46.8}},
    PublishedRates{"sibenik", "speculative_while_while", "gtx480", {243.4, 244.1, 94.7}},
    PublishedRates{"sibenik", "dynamic_fetch", "gtx680", {388.2, 441.2, 192.5}},
};

}  // namespace raydix::cli
