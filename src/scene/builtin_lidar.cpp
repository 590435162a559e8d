// Scene `lidar`: what a scanner with spinning beams sees on its way through the atrium.
// Columns of rays -> closest hits by the caller's tracer -> dropouts, range noise -> points in the
// order of the scan.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "scene/builtin.h"
#include "scene/builtin_math.h"

namespace raydix::builtin {

namespace {

constexpr double blind_range = 0.3;       // metres; nothing nearer returns an echo
constexpr double lowest = -30.0 / 360.0;  // of the beams, in turns
constexpr double highest = 35.0 / 360.0;
constexpr Point start{-4.5, 1.6, -0.4}, end{10.3, 1.6, 0.5};

/// All beams fire at once, column after column, while the head spins and the cart moves on.
struct Scanner {
    std::uint64_t beams;
    std::uint64_t columns;  // for the whole way
    std::uint64_t columns_a_turn;

    [[nodiscard]] Ray ray(std::uint64_t column, std::uint64_t beam) const {
        const double way =
            std::min(1.0, static_cast<double>(column) / static_cast<double>(columns));
        const Circle around = circle(static_cast<double>(column % columns_a_turn) /
                                     static_cast<double>(columns_a_turn));
        const double step = (static_cast<double>(beam) + 0.5) / static_cast<double>(beams);
        const Circle up = circle(mix(lowest, highest, step));
        Ray ray;
        ray.origin = to_vec3(mix(start, end, way));
        ray.direction = to_vec3({up.cos * around.cos, up.sin, -up.cos * around.sin});
        ray.tmin = static_cast<float>(blind_range);
        return ray;
    }
};

Scanner scanner_for(const LidarOptions& options) {
    const double echoes = static_cast<double>(options.beams) * (1.0 - options.dropout);
    const auto columns =
        static_cast<std::uint64_t>(static_cast<double>(options.points) / echoes) + 1;
    // Ten turns or more for a large scan; a small one still looks around once.
    const std::uint64_t least = std::min<std::uint64_t>(columns, 360);
    return {options.beams, columns, std::clamp<std::uint64_t>(columns / 10, least, 2048)};
}

}  // namespace

BuiltinResult make_lidar(const LidarOptions& options, std::uint64_t seed,
                         const SceneTracer& tracer) {
    if (!tracer) throw std::invalid_argument("builtin:lidar needs a function that traces rays");
    BuiltinResult result = make_atrium(options.triangles, seed);
    const Mesh hall = std::move(result.mesh);
    result.mesh = {};
    std::vector<Vec3>& points = result.mesh.vertices;
    points.reserve(options.points);

    const Scanner scanner = scanner_for(options);
    const std::uint64_t block =
        std::max<std::uint64_t>(1, (std::uint64_t{1} << 20) / scanner.beams);
    // The hall is closed, so a scan needs few more columns than planned; ten times as many mean
    // that the rays miss.
    const std::uint64_t most = 10 * scanner.columns + 1000;
    std::vector<Ray> rays;
    std::vector<Hit> hits;
    for (std::uint64_t column = 0; points.size() < options.points;) {
        if (column >= most) throw std::runtime_error("builtin:lidar: too few rays hit the atrium");
        const std::uint64_t last =
            std::min({column + block, most, std::max(scanner.columns, column + 64)});
        rays.clear();
        for (std::uint64_t c = column; c < last; ++c)
            for (std::uint64_t beam = 0; beam < scanner.beams; ++beam)
                rays.push_back(scanner.ray(c, beam));
        hits.assign(rays.size(), {});
        tracer(hall, rays, hits);
        for (std::size_t i = 0; i < rays.size() && points.size() < options.points; ++i) {
            Random random(seed + 1, column * scanner.beams + i);
            if (!hits[i].hit() || random.unit() < options.dropout) continue;
            const double range = static_cast<double>(hits[i].t) + options.noise * random.normal();
            const Vec3 o = rays[i].origin, d = rays[i].direction;
            points.push_back(to_vec3(Point{o.x, o.y, o.z} + Point{d.x, d.y, d.z} * range));
        }
        column = last;
    }
    return result;
}

}  // namespace raydix::builtin
