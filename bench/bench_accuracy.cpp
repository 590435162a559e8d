// How exact are t, u and v of hits? Ours and Embree's (default and robust) beside the same point of
// the plane in 113-bit arithmetic, for primary and shuffled diffuse rays, all of them and those at
// grazing angles apart. Only hits in which all name the same triangle count. Errors of t are parts
// of t, those of u and v are as they are: median, 99.99th percentile, largest. One JSON line per
// scene and kind of ray on standard output.
#include <fmt/format.h>
#include <raydix/machine.h>
#include <raydix/wide.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "cli/program.h"
#include "cli/ray_launches.h"
#include "cli/simulation.h"
#include "embree_scene.h"
#include "embree_trace.h"

namespace raydix::bench {
namespace {

using cli::Json;
__extension__ typedef __float128 Quad;

struct Quad3 {
    Quad x, y, z;
    explicit Quad3(Vec3 p) : x(p.x), y(p.y), z(p.z) {}
    Quad3(Quad a, Quad b, Quad c) : x(a), y(b), z(c) {}
};
Quad3 operator-(const Quad3& a, const Quad3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Quad dot(const Quad3& a, const Quad3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Quad3 cross(const Quad3& a, const Quad3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct Exact {
    Quad t, u, v;
    double sine;  // of the angle between ray and plane
};

/// Moeller and Trumbore 1997, in 113 bits.
Exact exact_hit(const Mesh& mesh, std::uint32_t prim, const Ray& ray) {
    const Triangle& corner = mesh.triangles[prim];
    const Quad3 v0(mesh.vertices[corner[0]]), origin(ray.origin), d(ray.direction);
    const Quad3 e1 = Quad3(mesh.vertices[corner[1]]) - v0,
                e2 = Quad3(mesh.vertices[corner[2]]) - v0;
    const Quad3 p = cross(d, e2), from = origin - v0, q = cross(from, e1), normal = cross(e1, e2);
    const Quad determinant = dot(e1, p);
    const auto size = [](const Quad3& a) { return std::sqrt(static_cast<double>(dot(a, a))); };
    return {dot(e2, q) / determinant, dot(from, p) / determinant, dot(d, q) / determinant,
            std::fabs(static_cast<double>(determinant)) / (size(normal) * size(d))};
}

/// Errors of one tracer.
struct Errors {
    std::vector<double> t, uv;

    void add(const Hit& hit, const Exact& exact) {
        const auto off = [](Quad a, Quad b) { return std::fabs(static_cast<double>(a - b)); };
        t.push_back(off(hit.t, exact.t) / std::fabs(static_cast<double>(exact.t)));
        uv.push_back(std::max(off(hit.u, exact.u), off(hit.v, exact.v)));
    }
};

/// Median, 99.99th percentile, largest.
std::array<double, 3> figures_of(std::vector<double>& errors) {
    if (errors.empty()) return {};
    std::ranges::sort(errors);
    const auto at = [&](double part) {
        return errors[static_cast<std::size_t>(part * static_cast<double>(errors.size() - 1))];
    };
    return {at(0.5), at(0.9999), errors.back()};
}

struct Options {
    cli::CommonOptions common;
    cli::LaunchOptions launches;
    std::vector<std::string> scenes{"builtin:atrium?triangles=100000"};
    std::string cameras_file;
    std::size_t ray_limit = 1'000'000;
    double grazing = 0.01;
};

class Accuracy {
public:
    Accuracy(const Options& options, const std::string& name) : options_(options) {
        cli::TreeOptions tree;
        tree.cameras_file = options.cameras_file;
        input_ = {cli::load_model_with_cameras(name, tree, options.common), {}};
        Mesh& mesh = input_.scene.mesh();
        mesh.vertices.reserve(mesh.vertices.size() + 1);  // Embree reads 16 bytes a vertex
        input_.bvh = build_bvh(mesh, {.builder = Builder::ploc});
        wide_ = WideBvh(input_.bvh);
        for (const RTCSceneFlags flags : {RTC_SCENE_FLAG_NONE, RTC_SCENE_FLAG_ROBUST}) {
            EmbreeOptions embree;
            embree.flags = flags;
            peers_.push_back(std::make_unique<EmbreeScene>(mesh, embree));
            peers_.back()->commit();
        }
    }

    void print(RayKind kind) {
        std::vector<Ray> rays = rays_of(kind);
        const std::vector<Hit> ours = trace(wide_, rays);
        std::array<std::vector<Hit>, 2> theirs;
        for (std::size_t k = 0; k < 2; ++k) {
            theirs[k].resize(rays.size());
            trace_embree(peers_[k]->scene(), {.width = 1, .coherent = false}, rays, theirs[k]);
        }
        std::array<Errors, 3> all, grazing;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const Hit* const hits[] = {&ours[i], &theirs[0][i], &theirs[1][i]};
            if (!ours[i].hit() || hits[1]->prim != ours[i].prim || hits[2]->prim != ours[i].prim)
                continue;
            const Exact exact = exact_hit(input_.scene.mesh(), ours[i].prim, rays[i]);
            for (std::size_t k = 0; k < 3; ++k) {
                all[k].add(*hits[k], exact);
                if (exact.sine < options_.grazing) grazing[k].add(*hits[k], exact);
            }
        }
        Json line = {{"scene", input_.scene.name},
                     {"rays", ray_kind_name(kind)},
                     {"count", rays.size()},
                     {"machine", machine_info().cpu},
                     {"seed", options_.common.seed}};
        line["all"] = errors_json(all);
        line["grazing"] = errors_json(grazing);
        fmt::print("{}\n", line.dump());
        std::fflush(stdout);
    }

private:
    static Json errors_json(std::array<Errors, 3>& errors) {
        static constexpr const char* names[] = {"raydix", "embree", "embree robust"};
        Json out = {{"hits", errors[0].t.size()}};
        std::array<std::array<double, 3>, 3> t{}, uv{};
        for (std::size_t k = 0; k < 3; ++k) {
            t[k] = figures_of(errors[k].t), uv[k] = figures_of(errors[k].uv);
            out[names[k]] = {{"t", t[k]}, {"uv", uv[k]}};
        }
        bool met = true;
        for (std::size_t f = 0; f < 3; ++f)
            met = met && t[0][f] <= std::min(t[1][f], t[2][f]) &&
                  uv[0][f] <= std::min(uv[1][f], uv[2][f]);
        out["no_larger"] = met;
        return out;
    }

    std::vector<Ray> rays_of(RayKind kind) const {
        const cli::RayLaunches launches(options_.launches, input_, options_.common);
        std::vector<Ray> rays;
        launches.for_each(kind, [&](const cli::RayUnit& unit, double) {
            const std::size_t room = options_.ray_limit - std::min(options_.ray_limit, rays.size());
            rays.insert(
                rays.end(), unit.rays.begin(),
                unit.rays.begin() + static_cast<std::ptrdiff_t>(std::min(room, unit.rays.size())));
        });
        return rays;
    }

    const Options& options_;
    cli::SceneTree input_;
    WideBvh wide_;
    std::vector<std::unique_ptr<EmbreeScene>> peers_;
};

}  // namespace
}  // namespace raydix::bench

int main(int argc, char** argv) {
    using namespace raydix;
    bench::Options options;
    options.launches.samples = 2;
    CLI::App app("Errors of t, u and v beside Embree's");
    app.add_option("SCENE", options.scenes, "Files or built-in scenes")->capture_default_str();
    app.add_option("--rays", options.ray_limit, "Most rays of a kind")->capture_default_str();
    app.add_option("--grazing", options.grazing,
                   "Rays count as grazing below this sine of their angle to the plane")
        ->capture_default_str();
    app.add_option("--cameras", options.cameras_file,
                   "Cameras file instead of cameras.json beside the scene");
    app.add_option("--seed", options.common.seed, "Seed of secondary rays")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        for (const std::string& name : options.scenes) {
            bench::Accuracy accuracy(options, name);
            accuracy.print(RayKind::primary);
            accuracy.print(RayKind::diffuse_shuffled);
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_accuracy: {}\n", error.what());
        return 1;
    }
    return 0;
}
