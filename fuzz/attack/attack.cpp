// Options, minimal meshes and reproducers for all kinds of attack.
#include "attack/attack.h"

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <numeric>

namespace raydix::attack {
namespace {

/// Made when the first kind enters: the order of files is the linker's.
std::vector<Kind>& entered_kinds() {
    static std::vector<Kind> kinds;
    return kinds;
}

}  // namespace

Kind::Kind(const char* its_name, void (*its_run)(Case&), double its_weight)
    : name(its_name), run(its_run), weight(its_weight) {
    entered_kinds().push_back(*this);
}

std::vector<Kind> all_kinds() {
    std::vector<Kind> kinds = entered_kinds();
    std::sort(kinds.begin(), kinds.end(),
              [](const Kind& a, const Kind& b) { return std::string_view(a.name) < b.name; });
    return kinds;
}

BuildOptions any_build_options(Random& random) {
    BuildOptions options;
    options.builder = static_cast<Builder>(random.below(10));
    options.bits = random.chance(0.3) ? 30 : 63;
    constexpr int leaves[] = {1, 1, 2, 3, 4, 4, 8, 16, 255};
    options.max_leaf = random.one_of(leaves);
    options.fit = static_cast<Fit>(random.below(3));
    options.threads = random.chance(0.9) ? 1 : 2;
    if (random.chance(0.3)) options.reinsertion_rounds = random.whole(1, 4);
    return options;
}

std::vector<BuildOptions> every_builder(Random& random) {
    std::vector<BuildOptions> all(10);
    for (std::uint32_t i = 0; i < all.size(); ++i) {
        all[i] = any_build_options(random);
        all[i].builder = static_cast<Builder>(i);
    }
    return all;
}

Mesh minimise(const Mesh& mesh, const std::function<bool(const Mesh&)>& fails) {
    std::vector<std::uint32_t> keep(mesh.triangles.size());
    std::iota(keep.begin(), keep.end(), 0u);
    int calls = 400;
    for (std::size_t part = std::max<std::size_t>(1, keep.size() / 2); calls > 0;) {
        bool dropped = false;
        for (std::size_t from = 0; from < keep.size() && keep.size() > 1 && calls-- > 0;) {
            std::vector<std::uint32_t> fewer = keep;
            const std::size_t to = std::min(from + part, keep.size());
            fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(from),
                        fewer.begin() + static_cast<std::ptrdiff_t>(to));
            if (!fewer.empty() && fails(only(mesh, fewer))) {
                keep = std::move(fewer);
                dropped = true;
            } else {
                from = to;
            }
        }
        if (part == 1 && !dropped) break;
        part = std::max<std::size_t>(1, part / 2);
    }
    return only(mesh, keep);
}

std::string text(const char* format, ...) {
    std::array<char, 2048> buffer;
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
    va_end(arguments);
    return buffer.data();
}

std::string text_of(const BuildOptions& options) {
    return text("builder %s, bits %d, max_leaf %d, fit %u, threads %d, reinsertion_rounds %d",
                std::string(builder_name(options.builder)).c_str(), options.bits, options.max_leaf,
                static_cast<unsigned>(options.fit), options.threads, options.reinsertion_rounds);
}
std::string text_of(Vec3 p) { return text("{%a, %a, %a}", p.x, p.y, p.z); }
std::string text_of(Vec3d p) { return text("{%a, %a, %a}", p.x, p.y, p.z); }

template <class AnyRay>
static std::string ray_text(const AnyRay& ray) {
    return text("    ray {%s, %a, %s, %a}\n", text_of(ray.origin).c_str(), double(ray.tmin),
                text_of(ray.direction).c_str(), double(ray.tmax));
}
std::string text_of(const Ray& ray) { return ray_text(ray); }
std::string text_of(const RayD& ray) { return ray_text(ray); }

template <class AnyHit>
static std::string hit_text(const AnyHit& hit) {
    return hit.hit() ? text("t %a (%.9g) prim %u u %a v %a", double(hit.t), double(hit.t), hit.prim,
                            double(hit.u), double(hit.v))
                     : std::string("a miss");
}
std::string text_of(const TreeHit& hit) { return hit_text(hit); }
std::string text_of(const TreeHitD& hit) { return hit_text(hit); }

template <class AnyMesh>
static std::string mesh_text(const AnyMesh& mesh) {
    constexpr std::size_t most = 8;
    std::string made;
    for (std::size_t i = 0; i < std::min(most, mesh.triangles.size()); ++i) {
        const Triangle& t = mesh.triangles[i];
        made += text("    triangle %zu: %s, %s, %s\n", i, text_of(mesh.vertices[t[0]]).c_str(),
                     text_of(mesh.vertices[t[1]]).c_str(), text_of(mesh.vertices[t[2]]).c_str());
    }
    if (mesh.triangles.size() > most)
        made += text("    and %zu more\n", mesh.triangles.size() - most);
    return made;
}
std::string text_of(const Mesh& mesh) { return mesh_text(mesh); }
std::string text_of(const MeshD& mesh) { return mesh_text(mesh); }

}  // namespace raydix::attack
