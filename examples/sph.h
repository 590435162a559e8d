// Smoothed particle hydrodynamics for example fluid: water in a tank.
#pragma once

#include <raydix/points.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "vec.h"

namespace example {

inline constexpr float pi = std::numbers::pi_v<float>;
inline constexpr float gravity = 9.81f, rest_density = 1000;
inline constexpr Vec3 tank{1.6f, 1.2f, 0.3f};    // metres; y is up, with a lid
inline constexpr Vec3 column{0.4f, 0.6f, 0.3f};  // of water, in the corner

/// The cubic spline in 3-D; `h` is half of its reach (Monaghan 1992).
struct Kernel {
    float h, factor;
    explicit Kernel(float length) : h(length), factor(1 / (pi * length * length * length)) {}
    [[nodiscard]] float operator()(float r) const {
        const float q = r / h, p = std::max(2 - q, 0.0f);
        return q < 1 ? factor * (1 - q * q * (1.5f - 0.75f * q)) : factor * 0.25f * p * p * p;
    }
    /// Derivative divided by r: times the difference of two places it is the gradient.
    [[nodiscard]] float slope(float r) const {
        const float q = r / h, p = std::max(2 - q, 0.0f);
        return q < 1 ? factor / (h * h) * (2.25f * q - 3) : -factor * 0.75f / (h * h) * p * p / q;
    }
};

class Fluid {
public:
    explicit Fluid(float spacing)
        : kernel_(1.3f * spacing),
          mass_(rest_density * spacing * spacing * spacing),
          sound_(10 * std::sqrt(2 * gravity * column.y)),
          step_(0.3f * kernel_.h / sound_) {
        fill(
            spacing, column, [](Vec3) { return true; }, water_);
        // Two layers around the tank, open above: as far as the kernel reaches.
        const Vec3 layers{2 * spacing, 2 * spacing, 2 * spacing};
        std::vector<Vec3> walls;
        const auto in_wall = [&](Vec3 p) {
            const Vec3 q = p - layers;
            return q.x < 0 || q.x > tank.x || q.y < 0 || q.z < 0 || q.z > tank.z;
        };
        fill(spacing, tank + 2 * layers, in_wall, walls);
        for (Vec3& p : walls) p = p - layers;
        walls_ = raydix::build_points(walls);
        wall_places_ = std::move(walls);
        speeds_.resize(water_.size(), Vec3{0, 0, 0});
        find_neighbours();
        find_densities();
        energy_at_start_ = energy();
    }

    /// One step by a half-explicit Euler scheme, which keeps energy well.
    void step() {
        const std::vector<Vec3> pushes = accelerations();
        for (std::size_t i = 0; i < water_.size(); ++i) {
            speeds_[i] += step_ * pushes[i];
            water_[i] += step_ * speeds_[i];
            stop(water_[i].x, speeds_[i].x, tank.x);
            stop(water_[i].y, speeds_[i].y, tank.y);
            stop(water_[i].z, speeds_[i].z, tank.z);
        }
        time += step_;
        find_neighbours();
        find_densities();
    }

    [[nodiscard]] std::span<const Vec3> water() const { return water_; }
    [[nodiscard]] std::span<const Vec3> speeds() const { return speeds_; }
    [[nodiscard]] std::size_t walls() const { return wall_places_.size(); }
    [[nodiscard]] double step_length() const { return step_; }

    /// Particles that are not in the tank any more.
    [[nodiscard]] std::size_t lost() const {
        std::size_t count = 0;
        for (const Vec3& p : water())
            count += !(p.x >= 0 && p.x <= tank.x && p.y >= 0 && p.y <= tank.y && p.z >= 0 &&
                       p.z <= tank.z);
        return count;
    }
    /// Kinetic, of place and of compression, in joules.
    [[nodiscard]] double energy() const {
        double sum = 0;
        for (std::size_t i = 0; i < water_.size(); ++i) {
            const double squeeze = densities_[i] / rest_density - 1;
            sum += mass_ * (0.5 * dot(speeds_[i], speeds_[i]) + gravity * water_[i].y +
                            0.5 * sound_ * sound_ * squeeze * squeeze);
        }
        return sum;
    }
    [[nodiscard]] double energy_gained() const { return energy() / energy_at_start_ - 1; }
    /// Mean of how far water is pressed together, part of its density.
    [[nodiscard]] double density_error() const {
        double sum = 0;
        for (std::size_t i = 0; i < water_.size(); ++i) sum += densities_[i] / rest_density - 1;
        return sum / static_cast<double>(water_.size());
    }
    /// Mean speed across the tank, metres a second: nothing drives it.
    [[nodiscard]] double drift() const {
        double sum = 0;
        for (const Vec3& v : speeds_) sum += v.z;
        return std::abs(sum) / static_cast<double>(water_.size());
    }
    /// Where the water at the bottom ends: no more than a few drops are ahead.
    [[nodiscard]] float front() const {
        std::vector<float> reach;
        for (const Vec3& p : water()) reach.push_back(p.x);
        const auto drop = reach.end() - 1 - static_cast<std::ptrdiff_t>(water_.size() / 500);
        std::ranges::nth_element(reach, drop);
        return *drop;
    }

    double time = 0, search_ms = 0;

private:
    template <class Where>
    static void fill(float spacing, Vec3 size, const Where& where, std::vector<Vec3>& out) {
        const Vec3 half{spacing / 2, spacing / 2, spacing / 2};
        for (float x = 0; x < size.x - half.x; x += spacing)
            for (float y = 0; y < size.y - half.y; y += spacing)
                for (float z = 0; z < size.z - half.z; z += spacing)
                    if (const Vec3 p = Vec3{x, y, z} + half; where(p)) out.push_back(p);
    }
    /// A drop alone has no pressure that would keep it off a wall.
    static void stop(float& place, float& speed, float side) {
        if (place >= 0 && place <= side) return;
        place = std::clamp(place, 0.0f, side);
        speed = 0;
    }

    void find_neighbours() {
        const auto start = std::chrono::steady_clock::now();
        index_.rebuild(water_);
        near_ = raydix::neighbour_lists(index_, 2 * kernel_.h, raydix::PairRows::half);
        near_walls_ = raydix::radius_search(walls_, water_, 2 * kernel_.h);
        search_ms +=
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
                .count();
    }
    /// Each pair once: with its place in the row of `lists`.
    template <class Pair>
    static void for_each_pair(const raydix::PointLists<float>& lists, const Pair& pair) {
        for (std::size_t i = 0; i + 1 < lists.offsets.size(); ++i)
            for (std::uint64_t k = lists.offsets[i]; k < lists.offsets[i + 1]; ++k)
                pair(i, lists.indices[k], lists.distances[k]);
    }

    /// Near the surface the sum lacks neighbours: water does not pull, so less than rest counts as
    /// rest.
    void find_densities() {
        densities_.assign(water_.size(), mass_ * kernel_(0));
        for_each_pair(near_, [&](std::size_t i, std::size_t j, float r) {
            const float part = mass_ * kernel_(r);
            densities_[i] += part;
            densities_[j] += part;
        });
        for_each_pair(near_walls_, [&](std::size_t i, std::size_t, float r) {
            densities_[i] += mass_ * kernel_(r);
        });
        for (float& density : densities_) density = std::max(density, rest_density);
    }

    /// What pushes a particle away from another: pressure over density squared of both, and
    /// artificial viscosity while they come closer (Monaghan 1992).
    [[nodiscard]] Vec3 push(Vec3 apart, Vec3 speed, float r, float press, float thickness) const {
        const float h = kernel_.h, closing = dot(speed, apart);
        if (closing < 0)
            press -= thickness * sound_ * h * closing / (rest_density * (r * r + 0.01f * h * h));
        return -(mass_ * press * kernel_.slope(std::max(r, 1e-3f * h))) * apart;
    }
    [[nodiscard]] std::vector<Vec3> accelerations() const {
        std::vector<float> press(water_.size());
        for (std::size_t i = 0; i < water_.size(); ++i)
            press[i] =
                sound_ * sound_ * (densities_[i] - rest_density) / (densities_[i] * densities_[i]);
        std::vector<Vec3> sum(water_.size(), Vec3{0, -gravity, 0});
        for_each_pair(near_, [&](std::size_t i, std::size_t j, float r) {
            const Vec3 by =
                push(water_[i] - water_[j], speeds_[i] - speeds_[j], r, press[i] + press[j], 0.05f);
            sum[i] += by;
            sum[j] += -1.0f * by;
        });
        for_each_pair(near_walls_, [&](std::size_t i, std::size_t j, float r) {
            sum[i] += push(water_[i] - wall_places_[j], speeds_[i], r, 2 * press[i], 0.01f);
        });
        return sum;
    }

    Kernel kernel_;
    float mass_, sound_, step_;
    std::vector<Vec3> water_, speeds_, wall_places_;
    std::vector<float> densities_;
    raydix::Points index_, walls_;
    raydix::PointLists<float> near_, near_walls_;
    double energy_at_start_ = 0;
};

}  // namespace example
