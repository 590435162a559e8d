// A terrain where maps put it, 4,500 km from the origin: heights and distances in double, and what
// float makes of them.
#include <raydix/raydix.h>

#include <cmath>
#include <cstdio>

int main() {
    // One metre between points, in metres east and north of a UTM zone's origin.
    raydix::MeshD terrain;
    constexpr std::uint32_t side = 200;
    const raydix::Vec3d corner{500'000.0, 4'500'000.0, 0.0};
    const auto height = [](double x, double y) { return std::sin(0.1 * x) + std::cos(0.07 * y); };
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x)
            terrain.vertices.push_back({corner.x + x, corner.y + y, height(x, y)});
    for (std::uint32_t y = 0; y + 1 < side; ++y)
        for (std::uint32_t x = 0; x + 1 < side; ++x) {
            const std::uint32_t at = y * side + x;
            terrain.triangles.push_back({at, at + 1, at + side});
            terrain.triangles.push_back({at + side + 1, at + side, at + 1});
        }

    const raydix::SceneD scene(terrain);
    double worst = 0.0, float_worst = 0.0;
    for (std::uint32_t k = 0; k + 1 < side; ++k) {  // straight down beside the points
        const double x = k + 0.25;
        const raydix::RayD down{{corner.x + x, corner.y + k, 1000.0}, 0.0, {0.0, 0.0, -1.0}};
        const raydix::HitD hit = raydix::closest_hit(scene, down);
        if (!hit.hit()) return 1;
        const double on_edge = 0.75 * height(k, k) + 0.25 * height(k + 1.0, k);
        worst = std::fmax(worst, std::fabs(1000.0 - hit.t - on_edge));
        const auto rounded = static_cast<double>(static_cast<float>(down.origin.y + 0.25));
        float_worst = std::fmax(float_worst, std::fabs(rounded - (down.origin.y + 0.25)));
    }
    const double above =
        raydix::closest_point(scene, {corner.x + 50, corner.y + 50, 60.0}).distance;
    std::printf("heights off by up to %.1e m; a float coordinate there is off by up to %.2f m\n",
                worst, float_worst);
    std::printf("a bird at 60 m is %.9f m from the ground\n", above);
    return worst < 1e-9 && above > 58.0 && above < 62.0 ? 0 : 1;
}
