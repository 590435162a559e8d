// A progressive path tracer: each bounce of all pixels is one batch, and so are its shadow rays.
// A cat and a mirror ball on a chequered floor, a square lamp above, sky around.
//     example_path_tracer [PICTURE.png|.exr] [WIDTH] [SAMPLES]
// Before the picture it proves itself: energy is kept in a white furnace, the two ways to find the
// lamp agree, and the number of threads changes no bit.
#include <raydix/raydix.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "vec.h"

namespace example {
namespace {

using raydix::Hit;
using raydix::Ray;

constexpr Vec3 lamp_corner{-0.7f, 3.2f, -0.9f}, lamp_s{1.4f, 0, 0}, lamp_t{0, 0, 1.4f};
constexpr float lamp_area = 1.4f * 1.4f;
constexpr Vec3 ball_middle{-0.75f, 0.28f, 0.75f};
constexpr float ball_radius = 0.3f;

/// Triangles by their order in the mesh: the cat's, then these.
struct World {
    raydix::Mesh mesh;
    std::size_t floor = 0, ball = 0, lamp = 0;  // where each begins

    void add(std::initializer_list<Vec3> corners) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), corners);
        mesh.triangles.push_back({first, first + 1, first + 2});
        if (corners.size() == 4) mesh.triangles.push_back({first, first + 2, first + 3});
    }
};

Vec3 on_ball(int row, int column) {
    const float a = std::numbers::pi_v<float> * static_cast<float>(row) / 64.0f;
    const float b = std::numbers::pi_v<float> * static_cast<float>(column) / 64.0f;
    const Vec3 way{std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b)};
    return ball_middle + ball_radius * way;
}

World make_world() {
    World world{raydix::load_model("builtin:figure?triangles=100000").mesh()};
    world.floor = world.mesh.triangles.size();
    const float y = raydix::inspect(world.mesh).bounds.lo.y;
    world.add({{-6, y, -6}, {-6, y, 6}, {6, y, 6}, {6, y, -6}});
    world.ball = world.mesh.triangles.size();
    for (int row = 0; row < 64; ++row)
        for (int column = 0; column < 128; ++column)
            world.add({on_ball(row, column), on_ball(row, column + 1), on_ball(row + 1, column + 1),
                       on_ball(row + 1, column)});
    world.lamp = world.mesh.triangles.size();
    world.add(
        {lamp_corner, lamp_corner + lamp_s, lamp_corner + lamp_s + lamp_t, lamp_corner + lamp_t});
    return world;
}

struct Settings {
    bool furnace = false;     // everything is white, the light comes from everywhere
    bool sample_lamp = true;  // aim at it, or wait until a path meets it
    bool sky = true;
    int threads = 0;
};

struct Path {
    Vec3 throughput{1, 1, 1};
    std::uint32_t pixel;
    Random random;
    bool sees_lamp = true;  // else the surface before has aimed at it already
    bool met_diffuse = false;
};

class PathTracer {
public:
    PathTracer(const World& world, const raydix::Scene& scene, const Settings& settings)
        : world_(world), scene_(scene), settings_(settings) {}

    /// One more path through every pixel, added to `sum`.
    void add_sample(std::uint32_t sample, raydix::Picture& sum) {
        start(sample, sum);
        for (int bounce = 0; bounce < 64 && !rays_.empty(); ++bounce) {
            const auto hits = raydix::trace(scene_, rays_, {.threads = settings_.threads});
            ray_count += rays_.size();
            next_rays_.clear(), next_paths_.clear(), shadow_rays_.clear(), lamp_light_.clear();
            for (std::size_t i = 0; i < hits.size(); ++i)
                shade(rays_[i], hits[i], paths_[i], bounce, sum);
            add_lamp(sum);
            rays_.swap(next_rays_), paths_.swap(next_paths_);
        }
    }

    std::size_t ray_count = 0;

private:
    void start(std::uint32_t sample, const raydix::Picture& sum) {
        constexpr Vec3 eye{-1.9f, 1.75f, 3.4f}, target{0.1f, 0.82f, -0.1f};
        const Vec3 ahead = unit(target - eye), right = unit(cross(ahead, {0, 1, 0}));
        const Vec3 up = cross(right, ahead);
        const float pixel_size = 0.72f / static_cast<float>(sum.height);
        rays_.clear(), paths_.clear();
        for (std::uint32_t y = 0; y < sum.height; ++y)
            for (std::uint32_t x = 0; x < sum.width; ++x) {
                const std::uint32_t pixel = y * sum.width + x;
                Path path{.pixel = pixel, .random = Random((std::uint64_t{pixel} << 32) + sample)};
                const auto at = [&](std::uint32_t k, std::uint32_t size) {
                    return static_cast<float>(k) + path.random() - 0.5f * static_cast<float>(size);
                };
                const float h = pixel_size * at(x, sum.width), v = pixel_size * at(y, sum.height);
                rays_.push_back({eye, 0, unit(ahead + h * right + -v * up)});
                paths_.push_back(path);
            }
    }

    [[nodiscard]] Vec3 sky(Vec3 way) const {
        if (settings_.furnace) return {1, 1, 1};
        if (!settings_.sky) return {0, 0, 0};
        const float up = 0.5f + 0.5f * way.y;
        return up * Vec3{0.16f, 0.22f, 0.34f} + (1 - up) * Vec3{0.30f, 0.26f, 0.21f};
    }
    [[nodiscard]] Vec3 lamp(bool below) const {
        return settings_.furnace || !below ? Vec3{0, 0, 0} : Vec3{21.0f, 17.5f, 13.0f};
    }
    [[nodiscard]] Vec3 colour(std::size_t prim, Vec3 point) const {
        if (settings_.furnace) return {1, 1, 1};
        if (prim >= world_.ball) return {0.92f, 0.92f, 0.92f};
        if (prim < world_.floor) return {0.72f, 0.45f, 0.24f};
        const int cell =
            static_cast<int>(std::floor(2 * point.x)) + static_cast<int>(std::floor(2 * point.z));
        return cell % 2 == 0 ? Vec3{0.75f, 0.75f, 0.72f} : Vec3{0.16f, 0.22f, 0.28f};
    }

    void shade(const Ray& ray, const Hit& hit, Path& path, int bounce, raydix::Picture& sum) {
        Vec3& pixel = sum.pixels[path.pixel];
        if (!hit.hit()) {
            pixel += path.throughput * sky(ray.direction);
            return;
        }
        const raydix::Triangle& corners = world_.mesh.triangles[hit.prim];
        const Vec3 a = world_.mesh.vertices[corners[0]], b = world_.mesh.vertices[corners[1]],
                   c = world_.mesh.vertices[corners[2]];
        const Vec3 place = (1 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        Vec3 normal = unit(cross(b - a, c - a));
        if (dot(normal, ray.direction) > 0) normal = -1.0f * normal;
        const Vec3 start = place + 1e-4f * normal;
        if (hit.prim >= world_.lamp && !settings_.furnace) {
            if (path.sees_lamp) pixel += path.throughput * lamp(normal.y < 0);
            return;
        }
        path.throughput = path.throughput * colour(hit.prim, place);
        if (bounce > 3 && !settings_.furnace) {  // Russian roulette
            const float left = std::max({path.throughput.x, path.throughput.y, path.throughput.z});
            if (path.random() >= left) return;
            path.throughput = (1 / left) * path.throughput;
        }
        const bool mirror = hit.prim >= world_.ball && hit.prim < world_.lamp;
        if (!mirror && settings_.sample_lamp) aim_at_lamp(start, normal, path);
        // Caustics of the ball are left out: so few paths meet them that they would be noise only.
        path.sees_lamp = mirror ? !path.met_diffuse : !settings_.sample_lamp;
        path.met_diffuse |= !mirror;
        const Vec3 way = mirror ? reflected(ray.direction, unit(place - ball_middle), normal)
                                : cosine_direction(Frame(normal), path.random);
        next_rays_.push_back({start, 0, way});
        next_paths_.push_back(path);
    }

    /// By the ball's own normal; by the triangle's where that would lead below it.
    static Vec3 reflected(Vec3 way, Vec3 smooth, Vec3 flat) {
        const Vec3 out = way - 2 * dot(way, smooth) * smooth;
        return dot(out, flat) > 0 ? out : way - 2 * dot(way, flat) * flat;
    }

    void aim_at_lamp(Vec3 from, Vec3 normal, Path& path) {
        const float s = path.random(), t = path.random();
        const Vec3 to_lamp = lamp_corner + s * lamp_s + t * lamp_t - from;
        const float d2 = dot(to_lamp, to_lamp);
        const float cosines = std::max(0.0f, dot(normal, to_lamp)) * std::max(0.0f, to_lamp.y) / d2;
        if (!(cosines > 0)) return;
        const float weight = cosines * lamp_area / (std::numbers::pi_v<float> * d2);
        shadow_rays_.push_back({from, 0, to_lamp, 0.9999f});
        lamp_light_.push_back({path.pixel, weight * (path.throughput * lamp(true))});
    }

    void add_lamp(raydix::Picture& sum) {
        hidden_.resize(shadow_rays_.size());
        raydix::trace_any(scene_, shadow_rays_, hidden_, {.threads = settings_.threads});
        ray_count += shadow_rays_.size();
        for (std::size_t i = 0; i < hidden_.size(); ++i)
            if (hidden_[i] == 0) sum.pixels[lamp_light_[i].pixel] += lamp_light_[i].light;
    }

    struct Light {
        std::uint32_t pixel;
        Vec3 light;
    };
    const World& world_;
    const raydix::Scene& scene_;
    Settings settings_;
    std::vector<Ray> rays_, next_rays_, shadow_rays_;
    std::vector<Path> paths_, next_paths_;
    std::vector<Light> lamp_light_;
    std::vector<std::uint8_t> hidden_;
};

raydix::Picture render(PathTracer tracer, std::uint32_t width, std::uint32_t samples) {
    raydix::Picture picture{width, width * 3 / 4, {}};
    picture.pixels.resize(std::size_t{width} * picture.height);
    for (std::uint32_t s = 0; s < samples; ++s) tracer.add_sample(s, picture);
    for (Vec3& p : picture.pixels) p = (1 / static_cast<float>(samples)) * p;
    return picture;
}

double mean_of(const raydix::Picture& picture) {
    double sum = 0;
    for (const Vec3& p : picture.pixels) sum += double{p.x} + double{p.y} + double{p.z};
    return sum / (3.0 * static_cast<double>(picture.pixels.size()));
}

bool prove(const World& world, const raydix::Scene& scene) {
    const double furnace = mean_of(render({world, scene, {.furnace = true}}, 64, 8));
    std::printf("white furnace: %.5f of the light arrives (wanted 1)\n", furnace);
    const double aimed = mean_of(render({world, scene, {.sky = false}}, 64, 256));
    const double met =
        mean_of(render({world, scene, {.sample_lamp = false, .sky = false}}, 64, 256));
    std::printf("lamp aimed at: %.4f, met by chance: %.4f, ratio %.3f\n", aimed, met, aimed / met);
    const auto one = render({world, scene, {.threads = 1}}, 64, 2);
    const auto two = render({world, scene, {.threads = 3}}, 64, 2);
    const bool same =
        hash_of(std::span<const Vec3>(one.pixels)) == hash_of(std::span<const Vec3>(two.pixels));
    std::printf("one thread and three: %s pixels\n", same ? "the same" : "DIFFERENT");
    return furnace > 0.995 && furnace < 1.0001 && std::abs(aimed / met - 1) < 0.04 && same;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    using namespace example;
    const std::string file = argc > 1 ? argv[1] : "path_tracer.png";
    const int width = argc > 2 ? std::atoi(argv[2]) : 160,
              samples = argc > 3 ? std::atoi(argv[3]) : 8;
    if (width < 4 || samples < 1) return std::fprintf(stderr, "a width, a number of samples\n"), 2;
    const World world = make_world();
    const raydix::Scene scene(world.mesh);
    if (!prove(world, scene)) return 1;
    PathTracer tracer(world, scene, {});
    raydix::Picture sum{
        static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(width * 3 / 4), {}};
    sum.pixels.resize(std::size_t{sum.width} * sum.height);
    for (int s = 1; s <= samples; ++s) {
        tracer.add_sample(static_cast<std::uint32_t>(s - 1), sum);
        if (s != samples && (s & (s - 1)) != 0) continue;  // a picture at 1, 2, 4, 8, ...
        raydix::Picture now = sum;
        for (Vec3& p : now.pixels) p = (1 / static_cast<float>(s)) * p;
        raydix::save_picture(file, now, true);
        std::printf("%d paths a pixel, %zu rays: mean %.4f\n", s, tracer.ray_count, mean_of(now));
    }
    return 0;
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
