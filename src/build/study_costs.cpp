// costs_of: runs of the study over bent sheets of several sizes -> what an item or a step of each
// kernel takes on this machine.
#include <raydix/hierarchy_study.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "exec/parallel.h"
#include "measure/launch_model.h"

namespace raydix {

/// Row by row, as a sum of waves: a surface as scanners and modellers leave it, with neighbours in
/// memory that are neighbours in space.
Mesh cost_sheet(std::uint32_t triangles, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    struct Wave {
        float x, y, phase, height;
    };
    std::array<Wave, 8> waves{};
    for (std::size_t k = 0; k < waves.size(); ++k) {
        const auto frequency = static_cast<float>(1u << k / 2) * 2.0f;
        waves[k] = {frequency * unit(random), frequency * unit(random),
                    2 * std::numbers::pi_v<float> * unit(random), 0.4f / frequency};
    }
    const auto side = static_cast<std::uint32_t>(std::max(1.0, std::sqrt(triangles / 2.0)));
    Mesh mesh;
    for (std::uint32_t y = 0; y <= side; ++y)
        for (std::uint32_t x = 0; x <= side; ++x) {
            const float u = static_cast<float>(x) / static_cast<float>(side);
            const float v = static_cast<float>(y) / static_cast<float>(side);
            float height = 0;
            for (const Wave& w : waves)
                height += w.height * std::sin(w.phase + 6 * (w.x * u + w.y * v));
            mesh.vertices.push_back({u, v, height});
        }
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t a = y * (side + 1) + x, b = a + side + 1;
            mesh.triangles.push_back({a, a + 1, b});
            mesh.triangles.push_back({a + 1, b + 1, b});
        }
    return mesh;
}

double work_of(const LaunchFigures& launch) {
    return static_cast<double>(launch.items) + static_cast<double>(launch.steps);
}

std::string kernel_of(const HierarchyRun& run, const LaunchFigures& launch) {
    return run.what.name() + ": " + launch.label;
}

MeasuredCosts costs_of(std::span<const std::vector<HierarchyRun>> sheets) {
    MeasuredCosts costs;
    with_threads(1, [&] {
        costs.launch_us = empty_launch_us();
        costs.latency_ns = memory_latency_ns();
    });
    struct Sample {
        KernelCost::Point point;
        double work;
    };
    std::map<std::string, std::vector<Sample>> samples;
    for (const std::vector<HierarchyRun>& sheet : sheets) {
        std::map<std::string, std::pair<double, double>> sums;  // kernel -> ns, work
        for (const HierarchyRun& run : sheet)
            for (const LaunchFigures& launch : run.launches) {
                auto& [ns, work] = sums[kernel_of(run, launch)];
                ns += launch.ms * 1e6 - costs.launch_us * 1e3;
                work += work_of(launch);
            }
        for (const auto& [kernel, sum] : sums)
            if (sum.second > 0)
                samples[kernel].push_back({{static_cast<double>(sheet.front().keys),
                                            std::max(0.0, sum.first / sum.second)},
                                           sum.second});
    }
    for (auto& [kernel, list] : samples) {
        // What did nearly nothing on one size says little of its cost: the sums of a prefix sum's
        // blocks share a name with a whole one.
        const auto counts = [](const Sample& s) { return s.work >= 0.01 * s.point.keys; };
        const bool any = std::ranges::any_of(list, counts);
        KernelCost cost{kernel, {}};
        for (const Sample& sample : list)
            if (!any || counts(sample)) cost.points.push_back(sample.point);
        std::ranges::sort(cost.points, {}, &KernelCost::Point::keys);
        costs.kernels.push_back(std::move(cost));
    }
    costs.origin =
        "measured with one thread: empty launches, a chain of loads in 64 MB, and each kernel on "
        "bent sheets of triangles, medians of processor time";
    return costs;
}

}  // namespace raydix
