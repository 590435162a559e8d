// Surface reconstruction: points become a closed mesh. Normals by the planes through the nearest
// neighbours, turned alike along a spanning tree (Hoppe et al. 1992); a signed distance from planes
// of the neighbours (implicit moving least squares, Kolluri 2005) at the corners of the finest
// cells of an octree of the points and of those around them; triangles by cutting each cell in six
// tetrahedra, which leaves no crack.
//     example_reconstruct [POINTS] [FOLDER] [WIDTH] [LEVEL of the octree] [X Y Z of the eye]
// POINTS is a file (z is up), or "cat": points on a built-in figure with noise. Writes
// reconstruct.ply and a picture. Judged for the cat: the mesh is closed, consistently oriented and
// of the same topology (Euler characteristic), and lies within the noise of the true surface. Of a
// file it tells how far its points are from the surface and how many edges are open; small pieces
// are left out of the mesh.
#include <raydix/raydix.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "cloud.h"
#include "contour.h"
#include "show.h"

namespace example {
namespace {

struct Distances {
    double mean = 0, most = 0;
};
Distances distances_to(const raydix::Scene& scene, std::span<const Vec3> points) {
    Distances out;
    for (const raydix::SceneClosestPoint& p : raydix::closest_points(scene, points)) {
        out.mean += p.distance / static_cast<double>(points.size());
        out.most = std::max(out.most, double{p.distance});
    }
    return out;
}

void save_ply(const std::filesystem::path& file, const raydix::Mesh& mesh) {
    std::FILE* out = std::fopen(file.string().c_str(), "wb");
    if (out == nullptr) throw raydix::InputError(file.string() + ": cannot be written");
    std::fprintf(out,
                 "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float x\n"
                 "property float y\nproperty float z\nelement face %zu\n"
                 "property list uchar int vertex_indices\nend_header\n",
                 mesh.vertices.size(), mesh.triangles.size());
    std::fwrite(mesh.vertices.data(), sizeof(Vec3), mesh.vertices.size(), out);
    for (const raydix::Triangle& t : mesh.triangles) {
        std::fputc(3, out);
        std::fwrite(t.data(), sizeof(std::uint32_t), 3, out);
    }
    std::fclose(out);
}

/// Points spread over a mesh, evenly by area, moved by up to `noise` along the normal.
std::vector<Vec3> sample(const raydix::Mesh& mesh, std::size_t count, float noise) {
    const auto corner = [&](std::size_t i, std::size_t k) {
        return mesh.vertices[mesh.triangles[i][k]];
    };
    std::vector<double> ends;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const Vec3 a = corner(i, 0);
        ends.push_back((ends.empty() ? 0 : ends.back()) +
                       length(cross(corner(i, 1) - a, corner(i, 2) - a)));
    }
    Random random(3);
    std::vector<Vec3> points;
    for (std::size_t n = 0; n < count; ++n) {
        // Strata: one point for each equal part of the area.
        const double at = (static_cast<double>(n) + random()) / static_cast<double>(count);
        const auto i = static_cast<std::size_t>(std::ranges::lower_bound(ends, at * ends.back()) -
                                                ends.begin());
        const Vec3 a = corner(i, 0), b = corner(i, 1) - a, c = corner(i, 2) - a;
        const float r = std::sqrt(random()), s = random();
        points.push_back(a + r * (1 - s) * b + r * s * c +
                         noise * (2 * random() - 1) * unit(cross(b, c)));
    }
    return points;
}

/// The mesh without its small pieces: those with less than a hundredth of the triangles of the
/// largest.
raydix::Mesh large_pieces(const raydix::Mesh& mesh) {
    std::vector<std::uint32_t> piece(mesh.vertices.size());
    for (std::uint32_t i = 0; i < piece.size(); ++i) piece[i] = i;
    const auto root = [&](std::uint32_t i) {
        while (piece[i] != i) i = piece[i] = piece[piece[i]];
        return i;
    };
    for (const raydix::Triangle& t : mesh.triangles) {
        piece[root(t[1])] = root(t[0]);
        piece[root(t[2])] = root(t[0]);
    }
    std::vector<std::size_t> size(mesh.vertices.size(), 0);
    for (const raydix::Triangle& t : mesh.triangles) ++size[root(t[0])];
    const std::size_t least = *std::ranges::max_element(size) / 100;
    raydix::Mesh kept;
    std::vector<std::uint32_t> number(mesh.vertices.size(), raydix::no_primitive);
    for (const raydix::Triangle& t : mesh.triangles) {
        if (size[root(t[0])] < least) continue;
        raydix::Triangle corners{};
        for (std::size_t k = 0; k < 3; ++k) {
            if (number[t[k]] == raydix::no_primitive) {
                number[t[k]] = static_cast<std::uint32_t>(kept.vertices.size());
                kept.vertices.push_back(mesh.vertices[t[k]]);
            }
            corners[k] = number[t[k]];
        }
        kept.triangles.push_back(corners);
    }
    return kept;
}

/// Positive if the triangles look outward.
double volume(const raydix::Mesh& mesh) {
    double sum = 0;
    for (const raydix::Triangle& t : mesh.triangles)
        sum += dot(mesh.vertices[t[0]], cross(mesh.vertices[t[1]], mesh.vertices[t[2]])) / 6.0;
    return sum;
}

raydix::Picture picture_of(const raydix::Mesh& mesh, std::uint32_t width, Vec3 up, Vec3 from) {
    std::vector<Vec3> normals(mesh.vertices.size(), Vec3{0, 0, 0});
    for (const raydix::Triangle& t : mesh.triangles) {
        const Vec3 a = mesh.vertices[t[0]];
        const Vec3 n = cross(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a);
        for (const std::uint32_t corner : t) normals[corner] += n;
    }
    const std::vector<Vec3> colours(mesh.triangles.size(), Vec3{0.52f, 0.46f, 0.38f});
    const raydix::Scene scene(mesh);
    Subject subject = subject_of(mesh, scene, colours, normals);
    subject.up = up;
    const raydix::Aabb box = raydix::inspect(mesh).bounds;
    const Vec3 middle = 0.5f * (box.lo + box.hi);
    const raydix::Camera camera{"", middle + 1.6f * subject.size * unit(from), middle, up, 32};
    return show(subject, camera, width, width, unit(from) + 0.7f * up + 0.5f * cross(up, from), 8);
}

int run(const std::string& source, const std::filesystem::path& folder, std::uint32_t width,
        int level, Vec3 from) {
    const Vec3 up = source == "cat" ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
    const bool known = source == "cat";
    constexpr float noise = 0.002f;
    const raydix::Mesh truth = known ? raydix::load_model("builtin:figure?triangles=40000").mesh()
                                     : raydix::load_mesh(source);
    const Cloud cloud(known ? sample(truth, level < 8 ? 60'000 : 240'000, noise) : truth.vertices);
    const Contour contour(cloud.points, level,
                          [&](auto places) { return cloud.distances_at(places); });
    const raydix::Mesh mesh = known ? contour.mesh() : large_pieces(contour.mesh());
    save_ply(folder / "reconstruct.ply", mesh);
    const EdgeCount edges = count_edges(mesh);
    const Distances off = distances_to(raydix::Scene(contour.mesh()), cloud.points);
    std::printf("%zu points, spacing %.4f; %zu cells of %.4f -> %zu vertices, %zu triangles\n",
                cloud.points.size(), double{cloud.spacing()}, contour.cells(),
                double{contour.cell_size()}, mesh.vertices.size(), mesh.triangles.size());
    std::printf(
        "edges: %zu open, %zu of more than two triangles, %zu turned against each other; "
        "Euler characteristic %lld\n",
        edges.open, edges.crowded, edges.against, edges.euler);
    std::printf("points are %.5f from the surface in the mean, %.5f at most\n", off.mean, off.most);
    raydix::save_picture(folder / "reconstruct.png", picture_of(mesh, width, up, from), true);
    if (!known) return mesh.triangles.empty() || edges.crowded != 0 ? 1 : 0;
    const Distances wrong = distances_to(raydix::Scene(truth), mesh.vertices);
    const long long wanted = count_edges(truth).euler;
    std::printf(
        "vertices are %.5f from the true surface in the mean, %.5f at most; noise %.3f; "
        "Euler characteristic there %lld\n",
        wrong.mean, wrong.most, double{noise}, wanted);
    return edges.open + edges.crowded + edges.against == 0 && edges.euler == wanted &&
                   volume(mesh) > 0 && wrong.mean < noise
               ? 0
               : 1;
}

}  // namespace
}  // namespace example

int main(int argc, char** argv) try {
    const std::string source = argc > 1 ? argv[1] : "cat";
    const std::filesystem::path folder = argc > 2 ? argv[2] : ".";
    const int width = argc > 3 ? std::atoi(argv[3]) : 96, level = argc > 4 ? std::atoi(argv[4]) : 7;
    if (width < 16 || level < 3 || level > 11)
        return std::fprintf(stderr, "points, a folder, a width, a level 3..11\n"), 2;
    const auto number = [&](int i) {
        return argc > i ? static_cast<float>(std::atof(argv[i])) : 0;
    };
    const example::Vec3 from{number(5), number(6), number(7)}, usual{1, -0.7f, 0.35f},
        cat{0.45f, 0.25f, 1};
    return example::run(source, folder, static_cast<std::uint32_t>(width), level,
                        argc > 7          ? from
                        : source == "cat" ? cat
                                          : usual);
} catch (const std::exception& error) {  // a folder that is not there, a file that cannot be read
    return std::fprintf(stderr, "%s\n", error.what()), 1;
}
