// The room of example photon_map: what it is made of, and what becomes of light in it.
#pragma once

#include <raydix/raydix.h>

#include <vector>

#include "vec.h"

namespace example {

using raydix::Hit;
using raydix::Ray;
inline constexpr float pi = std::numbers::pi_v<float>;
inline constexpr float off = 1e-4f;  // of rays from surfaces

enum class Matter { white, red, green, lamp, glass };

/// Triangles and what they are made of.
struct Room {
    raydix::Mesh mesh;
    std::vector<Matter> matter;
    raydix::Scene scene;
    Vec3 ball{0.45f, 0.36f, 0.35f};
    float ball_radius = 0.36f;

    void add(std::initializer_list<Vec3> corners, Matter of) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), corners);
        for (std::uint32_t k = 2; k < corners.size(); ++k) {
            mesh.triangles.push_back({first, first + k - 1, first + k});
            matter.push_back(of);
        }
    }
    void add_ball(Vec3 middle, float radius, int rows, Matter of) {
        const auto at = [&](int i, int j) {
            const float a = pi * static_cast<float>(i) / static_cast<float>(rows),
                        b = pi * static_cast<float>(j) / static_cast<float>(rows);
            return middle +
                   radius * Vec3{std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b)};
        };
        for (int i = 0; i < rows; ++i)
            for (int j = 0; j < 2 * rows; ++j)
                add({at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)}, of);
    }
    void finish() { scene = raydix::Scene(mesh); }

    [[nodiscard]] Vec3 albedo(std::uint32_t prim) const {
        switch (matter[prim]) {
            case Matter::red:
                return {0.65f, 0.10f, 0.07f};
            case Matter::green:
                return {0.12f, 0.45f, 0.12f};
            case Matter::lamp:
                return {0, 0, 0};
            default:
                return {0.72f, 0.72f, 0.70f};
        }
    }
    [[nodiscard]] Vec3 place(const Hit& hit) const {
        const raydix::Triangle& t = mesh.triangles[hit.prim];
        return (1 - hit.u - hit.v) * mesh.vertices[t[0]] + hit.u * mesh.vertices[t[1]] +
               hit.v * mesh.vertices[t[2]];
    }
    /// Against `way`; of the ball as if it were round.
    [[nodiscard]] Vec3 normal(const Hit& hit, Vec3 way) const {
        const raydix::Triangle& t = mesh.triangles[hit.prim];
        const Vec3 a = mesh.vertices[t[0]];
        Vec3 n = unit(cross(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a));
        if (matter[hit.prim] == Matter::glass) n = unit(place(hit) - ball);
        return dot(n, way) > 0 ? -1.0f * n : n;
    }
};

inline constexpr Vec3 lamp_corner{-0.25f, 1.98f, -0.25f}, lamp_s{0.5f, 0, 0}, lamp_t{0, 0, 0.5f};
inline constexpr float lamp_area = 0.25f, lamp_power = 20;

/// 2 metres wide, open toward the eye.
inline Room make_room(bool with_ball) {
    Room room;
    room.add({{-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}}, Matter::white);
    room.add({{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}}, Matter::white);
    room.add({{-1, 0, -1}, {1, 0, -1}, {1, 2, -1}, {-1, 2, -1}}, Matter::white);
    room.add({{-1, 0, -1}, {-1, 2, -1}, {-1, 2, 1}, {-1, 0, 1}}, Matter::red);
    room.add({{1, 0, -1}, {1, 0, 1}, {1, 2, 1}, {1, 2, -1}}, Matter::green);
    room.add(
        {lamp_corner, lamp_corner + lamp_s, lamp_corner + lamp_s + lamp_t, lamp_corner + lamp_t},
        Matter::lamp);
    const Vec3 a{-0.75f, 0, -0.35f}, s{0.5f, 0, -0.2f}, t{0.2f, 0, 0.5f}, up{0, 1.1f, 0};
    const Vec3 ring[] = {a, a + s, a + s + t, a + t};
    for (std::size_t k = 0; k < 4; ++k)
        room.add({ring[k], ring[(k + 1) % 4], ring[(k + 1) % 4] + up, ring[k] + up}, Matter::white);
    room.add({a + up, a + s + up, a + s + t + up, a + t + up}, Matter::white);
    if (with_ball) room.add_ball(room.ball, room.ball_radius, 96, Matter::glass);
    room.finish();
    return room;
}

/// What goes on after glass: reflected or bent, by chance as Fresnel's law has it.
inline Ray through_glass(const Ray& ray, Vec3 place, Vec3 normal, bool entering, float chance) {
    const float ratio = entering ? 1 / 1.5f : 1.5f, c = -dot(ray.direction, normal);
    const float rest = 1 - ratio * ratio * (1 - c * c);
    const float inside = std::sqrt(std::max(rest, 0.0f));
    const float a = (ratio * c - inside) / (ratio * c + inside),
                b = (c - ratio * inside) / (c + ratio * inside);
    if (rest <= 0 || chance < 0.5f * (a * a + b * b))
        return {place + off * normal, 0, unit(ray.direction + (2 * c) * normal)};
    return {place - off * normal, 0, unit(ratio * ray.direction + (ratio * c - inside) * normal)};
}

/// A photon or a path on its way.
struct Flight {
    Ray ray;
    Vec3 power;
    Random random;
    std::uint32_t pixel = 0;
};

/// All flights by one step: visit(flight, hit, place, normal) at whatever is not glass, says
/// whether it goes on.
template <class Visit>
void step(const Room& room, std::vector<Flight>& flights, const Visit& visit) {
    std::vector<Ray> rays;
    for (const Flight& f : flights) rays.push_back(f.ray);
    const std::vector<Hit> hits = raydix::trace(room.scene, rays);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < flights.size(); ++i) {
        Flight f = flights[i];
        if (!hits[i].hit()) continue;
        const Vec3 place = room.place(hits[i]), normal = room.normal(hits[i], f.ray.direction);
        if (room.matter[hits[i].prim] == Matter::glass) {
            const bool entering = dot(place - room.ball, normal) > 0;
            f.ray = through_glass(f.ray, place, normal, entering, f.random());
        } else if (!visit(f, hits[i], place, normal)) {
            continue;
        }
        flights[kept++] = f;
    }
    flights.erase(flights.begin() + static_cast<std::ptrdiff_t>(kept), flights.end());
}

}  // namespace example
