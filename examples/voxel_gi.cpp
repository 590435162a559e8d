// Voxel global illumination (after Crassin et al. 2011): the surfaces of a hall become points, the
// points an octree, and its nodes hold the light that the surfaces send out, averaged from the
// leaves up. Where a spotlight does not reach, six cones a pixel step through the octree.
//     example_voxel_gi [FOLDER] [WIDTH] [LEVEL]
// Writes the picture with direct light only and with the bounced light, and compares the latter
// with rays (one bounce, Monte Carlo) at some pixels. Cones find less: a coarse voxel hides more
// than the things in it do, which as many thin cones as rays show.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "voxel_tree.h"

namespace example {
namespace {

/// Irradiance by one cone along the normal and five around it, weighted by their solid angle and
/// cosine.
Vec3 gather_cones(const VoxelTree& voxels, const Point& p) {
    const Frame frame(p.normal);
    const Vec3 from = p.place + voxels.finest() * p.normal;
    Vec3 sum = 0.25f * voxels.cone(from, p.normal);
    for (int k = 0; k < 5; ++k) {
        const float angle = 2 * pi * static_cast<float>(k) / 5;
        sum += 0.15f *
               voxels.cone(from, frame(0.866f * std::cos(angle), 0.866f * std::sin(angle), 0.5f));
    }
    return pi * sum;
}

/// The same by many cones that never get wider than the finest voxel: what voxels alone cost.
Vec3 gather_thin_cones(const VoxelTree& voxels, const Point& p, std::uint64_t seed) {
    constexpr int count = 64;
    Random random(seed);
    const Frame frame(p.normal);
    Vec3 sum{0, 0, 0};
    for (int k = 0; k < count; ++k)
        sum += pi / count *
               voxels.cone(p.place + voxels.finest() * p.normal, cosine_direction(frame, random),
                           0.0f);
    return sum;
}

/// The same by rays: what it should be.
Vec3 gather_rays(const Hall& hall, const Point& p, std::uint64_t seed) {
    constexpr int count = 256;
    Random random(seed);
    std::vector<Ray> rays;
    for (int k = 0; k < count; ++k)
        rays.push_back(
            {p.place + start_off * p.normal, 0, cosine_direction(Frame(p.normal), random)});
    std::vector<Point> met;
    std::vector<Vec3> ways;
    for (std::size_t k = 0; const raydix::Hit& hit : hall.trace(rays)) {
        const Vec3 way = rays[k++].direction;
        if (!hit.hit()) continue;
        met.push_back(hall.point_of(hit.prim, hit.u, hit.v));
        ways.push_back(way);
    }
    const std::vector<float> light = hall.direct(met);  // turns normals to the lamp
    Vec3 sum{0, 0, 0};
    for (std::size_t k = 0; k < met.size(); ++k)
        if (dot(met[k].normal, ways[k]) < 0) sum += light[k] * albedo(met[k].place);
    return (1.0f / count) * sum;
}

float brightness(Vec3 v) { return (v.x + v.y + v.z) / 3; }

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    using namespace example;
    const std::filesystem::path folder = argc > 1 ? argv[1] : ".";
    const int width = argc > 2 ? std::atoi(argv[2]) : 128,
              level = argc > 3 ? std::atoi(argv[3]) : 7;
    if (width < 16 || level < 3 || level > 9)
        return std::fprintf(stderr, "a width, a level 3..9\n"), 2;
    const Hall hall;
    const VoxelTree voxels(hall, level);
    std::printf("%zu voxels, the finest %.2f m\n", voxels.size(), double{voxels.finest()});

    raydix::Picture direct{
        static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(width * 3 / 4), {}};
    direct.pixels.resize(std::size_t{direct.width} * direct.height);
    raydix::Picture both = direct;
    std::vector<std::uint32_t> pixels;
    const auto rays = raydix::make_primary_rays(hall.scene.cameras.cameras[0], direct.width,
                                                direct.height, &pixels);
    const auto hits = hall.trace(rays);
    double cones = 0, wanted = 0, cones2 = 0, wanted2 = 0, product = 0, dark = 0, n = 0, thin = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        Point p = hall.point_of(hits[i].prim, hits[i].u, hits[i].v);
        const Vec3 colour = (1 / pi) * albedo(p.place);
        Point to_lamp = p;
        float lit = hall.direct({&to_lamp, 1})[0];
        if (dot(to_lamp.normal, rays[i].direction) > 0) lit = 0;  // the other side
        if (dot(p.normal, rays[i].direction) > 0) p.normal = -1.0f * p.normal;
        const Vec3 bounced = gather_cones(voxels, p);
        direct.pixels[pixels[i]] = lit * colour;
        both.pixels[pixels[i]] = lit * colour + bounced * colour;
        if (i % 61 != 0) continue;
        const double ours = brightness(bounced), theirs = brightness(gather_rays(hall, p, i));
        thin += brightness(gather_thin_cones(voxels, p, i));
        cones += ours, wanted += theirs, product += ours * theirs, n += 1;
        cones2 += ours * ours, wanted2 += theirs * theirs, dark += lit == 0;
    }
    raydix::save_picture(folder / "voxel_gi_direct.png", direct, true);
    raydix::save_picture(folder / "voxel_gi.png", both, true);
    const double correlation =
        (n * product - cones * wanted) /
        std::sqrt((n * cones2 - cones * cones) * (n * wanted2 - wanted * wanted));
    std::printf(
        "%.0f pixels, %.0f %% without direct light: cones give %.2f of the bounced light of rays, "
        "correlation %.3f; many thin cones give %.2f\n",
        n, 100 * dark / n, cones / wanted, correlation, thin / wanted);
    const bool near = cones / wanted > 0.65 && cones / wanted < 1.1 && correlation > 0.75;
    return n > 20 && near && thin / wanted > 0.8 && thin / wanted < 1.1 ? 0 : 1;
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
