// Particle simulation: a dam breaks. Smoothed particle hydrodynamics, weakly compressible
// (Monaghan 1994; Becker, Teschner 2007), walls of particles that do not move
// and answer with the pressure they meet (Akinci et al. 2012).
// Each step rebuilds the index of the water in place and takes its neighbour lists from it; that of
// the walls is built once.
//     example_fluid [FOLDER] [WIDTH] [SPACING in metres] [SECONDS]
// Writes a picture of three times. Judged: no particle is lost, energy only goes down, the density
// error stays small, momentum across the tank stays near zero, and the front is slower than the one
// without friction that shallow water theory knows (Ritter 1892: 2 sqrt(g H)), but not by half.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "show.h"
#include "sph.h"

namespace example {
namespace {

raydix::Picture picture_of(const Fluid& fluid, std::uint32_t width, float spacing) {
    std::vector<raydix::Sphere> balls;
    for (const Vec3& p : fluid.water()) balls.push_back({p, 0.6f * spacing});
    const auto water = static_cast<std::uint32_t>(balls.size());
    for (float x = 0; x <= tank.x; x += 0.004f)  // the tank's edges; floor and back wall
        for (const float z : {0.0f, tank.z}) balls.push_back({{x, 0, z}, 0.004f});
    for (float y = 0; y <= tank.y; y += 0.004f)
        for (const float x : {0.0f, tank.x})
            for (const float z : {0.0f, tank.z}) balls.push_back({{x, y, z}, 0.004f});
    balls.push_back({{tank.x / 2, -400, tank.z / 2}, 400});
    balls.push_back({{tank.x / 2, 0, -400}, 400});
    raydix::Scene scene;
    scene.add(std::span<const raydix::Sphere>(balls));
    scene.commit();
    Subject subject;
    subject.trace = [&](std::span<const raydix::Ray> rays) { return raydix::trace(scene, rays); };
    subject.occluded = [&](std::span<const raydix::Ray> rays, std::span<std::uint8_t> out) {
        raydix::trace_any(scene, rays, out);
    };
    subject.surface = [&](const raydix::Hit& hit, Vec3 place) -> Surface {
        const Vec3 normal = unit(place - balls[hit.prim].center);
        if (hit.prim >= water) return {normal, {0.45f, 0.43f, 0.40f}};
        const float fast = std::min(length(fluid.speeds()[hit.prim]) / 3, 1.0f);
        return {normal, (1 - fast) * Vec3{0.03f, 0.15f, 0.45f} + fast * Vec3{0.75f, 0.85f, 0.90f}};
    };
    subject.size = 1;
    return show(subject, {"side", {1.05f, 0.75f, 2.7f}, {0.8f, 0.36f, 0.1f}, {0, 1, 0}, 24}, width,
                width / 2, {0.5f, 0.9f, 0.5f}, 12);
}

int run(const std::filesystem::path& folder, std::uint32_t width, float spacing, double seconds) {
    Fluid fluid(spacing);
    const auto start = std::chrono::steady_clock::now();
    double worst_density = 0, worst_energy = -1, drift = 0;
    double left = 0, arrived = 0;  // when the front passes two places
    int steps = 0, pictures = 0;
    raydix::Picture strip;
    for (; fluid.time < seconds; ++steps) {
        fluid.step();
        worst_density = std::max(worst_density, fluid.density_error());
        worst_energy = std::max(worst_energy, fluid.energy_gained());
        drift = std::max(drift, fluid.drift());
        if (fluid.front() < 2 * column.x) left = fluid.time;
        if (fluid.front() < tank.x - 0.2f) arrived = fluid.time;
        if (fluid.time >= seconds * (pictures + 1) / 3) {
            const raydix::Picture now = picture_of(fluid, width, spacing);
            strip.width = now.width, strip.height += now.height, ++pictures;
            strip.pixels.insert(strip.pixels.end(), now.pixels.begin(), now.pixels.end());
            std::printf("t %.2f s: front at %.2f m, density +%.2f %%, energy %+.2f %%\n",
                        fluid.time, double{fluid.front()}, 100 * fluid.density_error(),
                        100 * fluid.energy_gained());
        }
    }
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    raydix::save_picture(folder / "fluid.png", strip, true);
    const double speed = (tank.x - 0.2 - 2 * column.x) / (arrived - left) /
                         (2 * std::sqrt(double{gravity} * column.y));
    std::printf(
        "%zu particles of water, %zu of walls, %d steps of %.2e s: %.1f ms a step, %.1f of it "
        "index and neighbours\n",
        fluid.water().size(), fluid.walls(), steps, fluid.step_length(), ms / steps,
        fluid.search_ms / steps);
    std::printf(
        "%zu lost; density at most +%.2f %% (mean over particles), energy at most %+.3f %%, "
        "drift %.1e m/s; the front has %.2f of Ritter's speed\n",
        fluid.lost(), 100 * worst_density, 100 * worst_energy, drift, speed);
    return fluid.lost() == 0 && worst_density < 0.02 && worst_energy < 0.01 && drift < 0.15 &&
                   speed > 0.5 && speed < 1
               ? 0
               : 1;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int width = argc > 2 ? std::atoi(argv[2]) : 128;
    const double spacing = argc > 3 ? std::atof(argv[3]) : 0.04,
                 seconds = argc > 4 ? std::atof(argv[4]) : 0.6;
    if (width < 16 || !(spacing > 0.004 && spacing <= 0.06) || !(seconds > 0))
        return std::fprintf(stderr, "a width, a spacing from 0.005 to 0.06, seconds\n"), 2;
    return example::run(folder, static_cast<std::uint32_t>(width), static_cast<float>(spacing),
                        seconds);
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
