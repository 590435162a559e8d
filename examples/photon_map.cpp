// Photon mapping (Jensen 1996): photons leave a lamp, bounce through a room and stay where they
// meet a wall; light at a place is what the k nearest of them bring, over the area they lie on.
//     example_photon_map [FOLDER] [WIDTH] [PHOTONS] [K]
// Writes a room with a glass ball, which gathers light that no path from the eye would find. Judged
// twice: in a white hollow sphere the light is known exactly (Ulbricht 1900: it is the same
// everywhere, power / area / (1 - albedo)), and in the room, without the ball, paths traced from
// the walls to the lamp find as much.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "photon_room.h"

namespace example {
namespace {

/// Photons where they stay, those that came straight from the lamp left out if wanted.
class PhotonMap {
public:
    /// `start(random)`: a photon's first ray.
    template <class Start>
    PhotonMap(const Room& room, std::size_t count, Vec3 power, bool keep_direct,
              const Start& start) {
        std::vector<Flight> flights;
        for (std::size_t i = 0; i < count; ++i) {
            Random random(i);
            const Ray ray = start(random);
            flights.push_back({ray, (1.0f / static_cast<float>(count)) * power, random, 0});
        }
        for (int bounce = 0; !flights.empty() && bounce < 200; ++bounce)
            step(room, flights, [&](Flight& f, const Hit& hit, Vec3 place, Vec3 normal) {
                if (bounce > 0 || keep_direct) keep(f, place);
                const Vec3 white = room.albedo(hit.prim);
                const float stay = std::max({white.x, white.y, white.z});
                if (f.random() >= stay) return false;  // Russian roulette
                f.power = (1 / stay) * (f.power * white);
                f.ray = {place + off * normal, 0, cosine_direction(Frame(normal), f.random)};
                return true;
            });
        index_ = raydix::build_points(places_);
    }

    [[nodiscard]] std::size_t size() const { return places_.size(); }

    /// Irradiance at each place: power of the k nearest that came from this side, over their disc.
    [[nodiscard]] std::vector<Vec3> irradiance(std::span<const Vec3> places,
                                               std::span<const Vec3> normals,
                                               std::uint32_t k) const {
        const auto near = raydix::knn(index_, places, k);
        std::vector<Vec3> light(places.size(), Vec3{0, 0, 0});
        for (std::size_t i = 0; i < places.size(); ++i) {
            const float radius = near.distances[i * k + k - 1];
            // Cone filter (Jensen 1996): the nearer, the more.
            for (std::size_t j = i * k; j < (i + 1) * k; ++j) {
                const std::uint32_t photon = near.indices[j];
                if (photon == raydix::no_primitive || dot(ways_[photon], normals[i]) > 0) continue;
                light[i] += (1 - near.distances[j] / radius) * powers_[photon];
            }
            light[i] = (3 / (pi * radius * radius)) * light[i];
        }
        return light;
    }

private:
    void keep(const Flight& f, Vec3 place) {
        places_.push_back(place);
        ways_.push_back(f.ray.direction);
        powers_.push_back(f.power);
    }
    std::vector<Vec3> places_, ways_, powers_;
    raydix::Points index_;
};

Ray from_lamp(Random& random) {
    const float t = random(), s = random();
    const Vec3 place = lamp_corner + s * lamp_s + t * lamp_t;
    return {place - Vec3{0, off, 0}, 0, cosine_direction(Frame({0, -1, 0}), random)};
}
/// Of what meets the lamp from below.
Vec3 lamp_radiance(Vec3 way) {
    return way.y > 0 ? (lamp_power / (pi * lamp_area)) * Vec3{1, 1, 1} : Vec3{0, 0, 0};
}

double grey(Vec3 v) { return (double{v.x} + v.y + v.z) / 3; }

struct Error {
    double ratio;  // of the sums
    double rms;    // of single values, part of the wanted
};
Error compare(std::span<const Vec3> found, std::span<const Vec3> wanted) {
    double f = 0, w = 0, squares = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        f += grey(found[i]), w += grey(wanted[i]);
        const double part = grey(found[i]) / grey(wanted[i]) - 1;
        squares += part * part;
    }
    return {f / w, std::sqrt(squares / static_cast<double>(found.size()))};
}

/// All light but the direct one, which depends on where in the sphere the lamp is.
Error hollow_sphere(std::size_t photons, std::uint32_t k) {
    Room sphere;
    sphere.add_ball({0, 0, 0}, 1, 96, Matter::white);
    sphere.finish();
    const PhotonMap map(sphere, photons, {1, 1, 1}, false, [](Random& random) -> Ray {
        const float z = 2 * random() - 1, a = 2 * pi * random(), r = std::sqrt(1 - z * z);
        return {{0.4f, 0.1f, 0}, 0, {r * std::cos(a), r * std::sin(a), z}};
    });
    std::vector<Vec3> places, normals, wanted;
    for (std::uint32_t i = 0; i < sphere.mesh.triangles.size(); i += 37) {
        const Hit middle = raydix::hit_of_tree({0, i, 1.0f / 3, 1.0f / 3});
        places.push_back(sphere.place(middle));
        normals.push_back(-1.0f * unit(places.back()));
        const Vec3 white = sphere.albedo(i), one{1, 1, 1}, rest = one - white;
        wanted.push_back(1 / (4 * pi) * Vec3{white.x / rest.x, white.y / rest.y, white.z / rest.z});
    }
    return compare(map.irradiance(places, normals, k), wanted);
}

/// Paths from the walls that end at the lamp, against photons from the lamp that end at the walls.
Error plain_room(std::size_t photons, std::uint32_t k, int paths) {
    const Room room = make_room(false);
    const PhotonMap map(room, photons, lamp_power * Vec3{1, 1, 1}, true, from_lamp);
    std::vector<Vec3> places, normals;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) {
            const float x = -0.75f + 0.3f * static_cast<float>(i), y = static_cast<float>(j);
            places.insert(places.end(), {{x, 0, 0.25f + 0.12f * y}, {x, 0.25f + 0.3f * y, -1}});
            normals.insert(normals.end(), {{0, 1, 0}, {0, 0, 1}});
        }
    std::vector<Flight> flights;
    for (std::uint32_t i = 0; i < places.size(); ++i)
        for (int n = 0; n < paths; ++n) {
            Random random(i * 1'000'003u + static_cast<std::uint32_t>(n));
            const Vec3 way = cosine_direction(Frame(normals[i]), random);
            flights.push_back({{places[i] + off * normals[i], 0, way}, {1, 1, 1}, random, i});
        }
    std::vector<Vec3> wanted(places.size(), Vec3{0, 0, 0});
    while (!flights.empty())
        step(room, flights, [&](Flight& f, const Hit& hit, Vec3 place, Vec3 normal) {
            if (room.matter[hit.prim] == Matter::lamp) {
                wanted[f.pixel] +=
                    (pi / static_cast<float>(paths)) * (f.power * lamp_radiance(f.ray.direction));
                return false;
            }
            if (f.random() >= 0.75f) return false;
            f.power = (1 / 0.75f) * (f.power * room.albedo(hit.prim));
            f.ray = {place + off * normal, 0, cosine_direction(Frame(normal), f.random)};
            return true;
        });
    return compare(map.irradiance(places, normals, k), wanted);
}

/// Light straight from the lamp, by one shadow ray each.
std::vector<Vec3> direct(const Room& room, std::span<const Vec3> places,
                         std::span<const Vec3> normals, int sample) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < places.size(); ++i) {
        Random random((std::uint64_t{1} << 40) * static_cast<std::uint64_t>(sample + 1) + i);
        const Vec3 from = places[i] + off * normals[i];
        rays.push_back(
            {from, 0, lamp_corner + random() * lamp_s + random() * lamp_t - from, 0.999f});
    }
    std::vector<std::uint8_t> hidden(rays.size());
    raydix::trace_any(room.scene, rays, hidden);
    std::vector<Vec3> light(places.size(), Vec3{0, 0, 0});
    for (std::size_t i = 0; i < places.size(); ++i) {
        const Vec3 way = rays[i].direction;
        const float d2 = dot(way, way), cosines = dot(way, normals[i]) * way.y / d2;
        if (hidden[i] == 0 && cosines > 0 && way.y > 0)
            light[i] = (lamp_area * cosines / d2) * lamp_radiance(way);
    }
    return light;
}

raydix::Picture render(std::size_t photons, std::uint32_t k, std::uint32_t width, int samples) {
    const Room room = make_room(true);
    const PhotonMap map(room, photons, lamp_power * Vec3{1, 1, 1}, false, from_lamp);
    std::printf("%zu photons stay in the room of the picture\n", map.size());
    raydix::Picture picture{width, width, std::vector<Vec3>(std::size_t{width} * width)};
    const float part = 1.0f / static_cast<float>(samples);
    for (int sample = 0; sample < samples; ++sample) {
        std::vector<Flight> flights;
        for (std::uint32_t i = 0; i < width * width; ++i) {
            Random random(std::uint64_t{i} * 4096 + static_cast<std::uint64_t>(sample));
            const float scale = 0.7f / static_cast<float>(width);
            const float x = scale * (static_cast<float>(i % width) + random()) - 0.35f,
                        y = 0.35f - scale * (static_cast<float>(i / width) + random());
            flights.push_back({{{0, 1, 4.05f}, 0, unit({x, y, -1})}, {1, 1, 1}, random, i});
        }
        std::vector<Vec3> places, normals, colours;
        std::vector<std::uint32_t> pixels;
        for (int bounce = 0; bounce < 12 && !flights.empty(); ++bounce)
            step(room, flights, [&](const Flight& f, const Hit& hit, Vec3 place, Vec3 normal) {
                if (room.matter[hit.prim] == Matter::lamp)
                    picture.pixels[f.pixel] += part * lamp_radiance(f.ray.direction);
                places.push_back(place), normals.push_back(normal), pixels.push_back(f.pixel);
                colours.push_back(part / pi * room.albedo(hit.prim));
                return false;
            });
        const std::vector<Vec3> gathered = map.irradiance(places, normals, k),
                                straight = direct(room, places, normals, sample);
        for (std::size_t i = 0; i < places.size(); ++i)
            picture.pixels[pixels[i]] += colours[i] * (gathered[i] + straight[i]);
    }
    return picture;
}

int run(const std::filesystem::path& folder, std::uint32_t width, std::size_t photons,
        std::uint32_t k) {
    const Error sphere = hollow_sphere(photons, k);
    std::printf("hollow sphere: %.4f of the light it must have, rms error of a place %.1f %%\n",
                sphere.ratio, 100 * sphere.rms);
    const Error room = plain_room(photons, k, 30'000);
    std::printf("room: %.4f of the light that paths find, rms error of a place %.1f %%\n",
                room.ratio, 100 * room.rms);
    raydix::save_picture(folder / "photon_map.png", render(photons, k, width, 16), true);
    return std::abs(sphere.ratio - 1) < 0.02 && sphere.rms < 0.25 &&
                   std::abs(room.ratio - 1) < 0.03 && room.rms < 0.25
               ? 0
               : 1;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int width = argc > 2 ? std::atoi(argv[2]) : 96,
              photons = argc > 3 ? std::atoi(argv[3]) : 100'000,
              k = argc > 4 ? std::atoi(argv[4]) : 100;
    if (width < 16 || photons < 1000 || k < 2)
        return std::fprintf(stderr, "a width, 1000 photons or more, k from 2 on\n"), 2;
    return example::run(folder, static_cast<std::uint32_t>(width),
                        static_cast<std::size_t>(photons), static_cast<std::uint32_t>(k));
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
