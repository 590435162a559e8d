// .rdx files of scenes: what was saved comes back the same; bytes changed at random, checksums
// mended, are refused or load to a scene with the hits of one that is made anew from the same
// tables.
#include <raydix/error.h>
#include <raydix/rdx_scene.h>
#include <raydix/surface.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "attack/any_transform.h"
#include "attack/attack.h"
#include "attack/file_bytes.h"
#include "attack/ray_families.h"
#include "engine/extent.h"
#include "engine/hit_points.h"
#include "engine/scene_state.h"
#include "io/rdx_parse.h"
#include "io/rdx_scene_format.h"

namespace raydix::attack {
namespace {

/// The first few are extreme.
std::vector<Ray> any_rays(Random& random, const Mesh& mesh, std::size_t count) {
    std::vector<Ray> rays = make_extreme_rays(random, mesh, 4);
    const std::vector<Ray> others = make_rays(random, mesh, count);
    rays.insert(rays.end(), others.begin(), others.end());
    return rays;
}

/// Of a mesh of its own, or now and then none.
Mesh mesh_of_a_scene(Random& random) {
    // Those that stay within the range of coordinates wherever they are placed.
    constexpr Family families[] = {Family::soup,       Family::needles,   Family::integer_coplanar,
                                   Family::grid,       Family::sphere,    Family::voxels,
                                   Family::duplicates, Family::zero_area, Family::fan,
                                   Family::subnormal,  Family::non_finite};
    if (random.chance(0.05)) return {};
    return make_mesh(random, random.one_of(families), 1 + random.below(16)).mesh;
}

std::uint32_t any_mask(Random& random) {
    return random.chance(0.6) ? 0xFFFFFFFFu : random.below(8);
}

/// What a commit is changed by before the next one: ids are left out, trees are refitted.
void change(Random& random, Scene& scene, std::uint32_t ids) {
    for (std::uint32_t id = 0; id < ids; ++id) {
        if (!scene.contains(id) || random.chance(0.6)) continue;
        if (random.chance(0.3))
            scene.remove(id);
        else
            scene.set_mask(id, any_mask(random));
    }
    if (random.chance(0.5)) scene.add(mesh_of_a_scene(random));
}

/// One scene or several in each other; the last one shows the one before it. Throws InputError if
/// one reaches beyond the range of coordinates.
Scene try_scene(Random& random) {
    const SceneOptions options{.quality = static_cast<Quality>(random.below(3)),
                               .usage = static_cast<Usage>(random.below(2)),
                               .compact = random.chance(0.4),
                               .threads = 1};
    std::vector<Scene> scenes;
    const std::uint32_t count = 1 + random.below(4);
    for (std::uint32_t k = 0; k < count; ++k) {
        Scene scene;
        std::uint32_t id = 0;
        const std::uint32_t geometries = 1 + random.below(4);
        for (std::uint32_t g = 0; g < geometries; ++g) {
            id += random.below(3);
            const GeometryOptions with{.mask = any_mask(random), .id = id++};
            if (k == 0 || random.chance(0.4)) {
                scene.add(mesh_of_a_scene(random), with);
                continue;
            }
            Transform transform = any_transform<Transform>(random);
            while (!inverse_of(affine_of(transform))) transform = any_transform<Transform>(random);
            scene.add(scenes[g == 0 ? k - 1 : random.below(k)], transform, with);
        }
        scene.commit(options);
        if (random.chance(0.3)) {
            change(random, scene, id);
            scene.commit(options);
        }
        scenes.push_back(std::move(scene));
    }
    return std::move(scenes.back());
}

Scene any_scene(Random& random) {
    for (;;) try {
            return try_scene(random);
        } catch (const InputError&) {  // the next one may be smaller
        }
}

/// The tables of a file that was loaded.
class Tables {
public:
    Tables(const std::string& file, const SealedFile& sealed)
        : sections_(file, sealed.view, sealed.owner, rdx::version_of(file, sealed.view),
                    rdx::scene_kinds_of(rdx::version_of(file, sealed.view))) {
        const auto vertices = sections_.view<Vec3>(rdx::scene_vertices);
        const auto triangles = sections_.view<Triangle>(rdx::scene_triangles);
        std::size_t v = 0, t = 0;
        for (const StoredMesh& mesh : sections_.view<StoredMesh>(rdx::scene_meshes)) {
            meshes_.emplace_back(vertices.subspan(v, mesh.vertices),
                                 triangles.subspan(t, mesh.triangles));
            v += mesh.vertices, t += mesh.triangles;
        }
        const auto geometries = sections_.view<StoredGeometry>(rdx::scene_geometries);
        std::size_t g = 0;
        for (const StoredScene& scene : sections_.view<StoredScene>(rdx::scene_scenes)) {
            geometries_.push_back(geometries.subspan(g, scene.geometry_count));
            g += scene.geometry_count;
        }
    }

    /// The same scene with trees of its own, which hold no parts of triangles.
    [[nodiscard]] Scene made_anew() const {
        const auto stored = sections_.view<StoredScene>(rdx::scene_scenes);
        std::vector<Scene> scenes;
        for (std::size_t k = 0; k < stored.size(); ++k) {
            Scene scene;
            for (const StoredGeometry& geometry : geometries_[k]) {
                const GeometryOptions with{.mask = geometry.mask, .id = geometry.id};
                if (geometry.kind == stored_instance)
                    scene.add(scenes[geometry.number], geometry.transform, with);
                else
                    scene.add(
                        geometry.number == stored_none ? MeshView() : meshes_[geometry.number],
                        with);
            }
            scene.commit({.quality = Quality::fast,
                          .usage = static_cast<Usage>(stored[k].usage),
                          .compact = stored[k].compact != 0,
                          .threads = 1});
            scenes.push_back(std::move(scene));
        }
        return std::move(scenes.back());
    }

    /// Triangles in the world, on some hundred paths at most.
    [[nodiscard]] Mesh flat() const {
        Mesh out;
        std::vector<Affine> way;
        add(geometries_.size() - 1, way, out);
        return out;
    }

private:
    void add(std::size_t scene, std::vector<Affine>& way, Mesh& out) const {
        constexpr std::size_t most = 1000;
        for (const StoredGeometry& geometry : geometries_[scene]) {
            if (out.triangles.size() > most) return;
            if (geometry.kind == stored_instance) {
                way.push_back(affine_of(geometry.transform));
                add(geometry.number, way, out);
                way.pop_back();
            } else if (geometry.number != stored_none) {
                add(meshes_[geometry.number], way, out);
            }
        }
    }
    static void add(const MeshView& mesh, const std::vector<Affine>& way, Mesh& out) {
        for (const Triangle& triangle : mesh.triangles) {
            Vec3 corners[3];
            for (std::size_t k = 0; k < 3; ++k) {
                Double3 p(mesh.vertices[triangle[k]]);
                for (std::size_t level = way.size(); level-- > 0;) p = way[level].point(p);
                corners[k] = p.rounded();
            }
            add_triangle(out, corners[0], corners[1], corners[2]);
        }
    }

    rdx::Sections sections_;
    std::vector<MeshView> meshes_;
    std::vector<std::span<const StoredGeometry>> geometries_;  // of each scene
};

/// How far the point of a hit may lie beside the scene's bounds: what floats and doubles round on
/// the way there.
double slack_of(const SceneTree& tree, const Hit& hit) {
    HitTriangle triangle;
    if (!find_triangle(tree, hit, triangle)) return -1;
    double size = 0;
    const auto largest = [](Double3 p) {
        return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    };
    for (const Double3& corner : triangle.corners) size = std::max(size, largest(corner));
    for (std::uint32_t level = triangle.levels; level-- > 0;) {
        const Affine map = affine_of(triangle.way[level]->transform);
        size = norm_of(map) * size + largest(map.move);
    }
    return 0x1p-20 * size + 0x1p-149;
}

bool within(const Aabb& box, Vec3 p, double slack) {
    const auto inside = [&](double lo, double hi, double x) {
        return lo - slack <= x && x <= hi + slack;
    };
    return inside(box.lo.x, box.hi.x, p.x) && inside(box.lo.y, box.hi.y, p.y) &&
           inside(box.lo.z, box.hi.z, p.z);
}

/// Triangles in the leaves of all its trees.
std::uint64_t references_of(const SceneTree& scene, std::set<const SceneTree*>& seen) {
    std::uint64_t sum = 0;
    if (!seen.insert(&scene).second) return sum;
    for (const auto& mesh : scene.meshes) sum += mesh->tree->stats().references;
    for (const InstanceName& instance : scene.instances)
        sum += references_of(*instance.scene, seen);
    return sum;
}
std::uint64_t references_of(const Scene& scene) {
    std::set<const SceneTree*> seen;
    return references_of(*SceneInternals::tree(scene), seen);
}

/// All that can be asked of a scene.
struct SceneAnswers {
    std::vector<Hit> closest;
    std::vector<std::uint8_t> any;
    AllHits all;
};

SceneAnswers answers_of(const Scene& scene, std::span<const Ray> rays,
                        std::span<const std::uint32_t> masks) {
    const SceneTraceOptions options{.masks = masks, .threads = 1};
    SceneAnswers out{trace(scene, rays, options), std::vector<std::uint8_t>(rays.size()),
                     trace_all(scene, rays, options)};
    trace_any(scene, rays, out.any, options);
    return out;
}

std::vector<std::uint32_t> any_masks(Random& random, std::size_t count) {
    std::vector<std::uint32_t> masks(count);
    for (std::uint32_t& mask : masks) mask = any_mask(random);
    return masks;
}

/// What scenes in files are asked, and what is right for each.
class SceneJudge {
public:
    SceneJudge(Case& c, const char* group) : case_(c), group_(group) {}

    /// The same answers from both, and what `scene` says of its hits agrees with itself.
    void compare(const Scene& scene, const Scene& wanted, std::span<const Ray> rays) {
        const std::vector<std::uint32_t> masks = any_masks(case_.random, rays.size());
        const SceneAnswers got = answers_of(scene, rays, masks),
                           right = answers_of(wanted, rays, masks);
        expect(same_bytes(got.closest, right.closest), "closest hits");
        expect(same_bytes(got.any, right.any), "any hits");
        expect(got.all.offsets == right.all.offsets && same_bytes(got.all.hits, right.all.hits),
               "all hits");
        for (std::size_t i = 0; i < std::min<std::size_t>(rays.size(), 8); ++i) {
            expect(same_bytes(std::span(&got.closest[i], 1),
                              std::span<const Hit>(
                                  std::vector<Hit>{closest_hit(scene, rays[i], masks[i])})),
                   "single closest");
            expect(any_hit(scene, rays[i], masks[i]) == (got.any[i] != 0), "single any");
        }
        expect_places(scene, got.closest);
        expect_places(scene, got.all.hits);
    }
    /// A scene whose trees hold parts of triangles: a stranger's file may have hidden some of them
    /// from rays, and no more than that.
    void bear(const Scene& scene, std::span<const Ray> rays) {
        const SceneAnswers got = answers_of(scene, rays, any_masks(case_.random, rays.size()));
        expect_places(scene, got.closest);
        expect_places(scene, got.all.hits);
    }

private:
    /// Points of hits lie within the scene's bounds, and paths lead somewhere.
    void expect_places(const Scene& scene, std::span<const Hit> hits) {
        const std::vector<Vec3> points = positions(scene, hits, 1);
        (void)normals(scene, hits, 1);
        const SceneTree& tree = *SceneInternals::tree(scene);
        for (std::size_t i = 0; i < hits.size(); ++i) {
            if (!hits[i].hit()) continue;
            expect(within(scene.bounds(), points[i], slack_of(tree, hits[i])),
                   "a point beside the bounds");
            if (i % 8 == 0)
                expect(scene.path(hits[i].instance).empty() == (hits[i].instance == 0), "a path");
        }
    }
    void expect(bool right, const char* what) { case_.expect(right, group_, what); }

    Case& case_;
    const char* group_;
};

/// Those of a file that is right; the header too.
std::vector<Stretch> stretches_of(const Bytes& bytes) {
    constexpr std::size_t header =
        sizeof(rdx::HeaderStart) + rdx::scene_section_count * sizeof(rdx::Section);
    std::vector<Stretch> out{{0, header}};
    for (std::size_t id = 0; id < rdx::scene_section_count; ++id) {
        rdx::Section section;
        std::memcpy(&section, bytes.data() + sizeof(rdx::HeaderStart) + id * sizeof(section),
                    sizeof(section));
        const std::size_t length = section.count * section.element_bytes;
        if (length > 0) out.push_back({section.offset, section.offset + length});
    }
    return out;
}

std::vector<std::string_view> scene_sections() {
    std::vector<std::string_view> out{"header"};
    for (const rdx::SectionKind& kind : rdx::scene_kinds) out.push_back(kind.name);
    return out;
}

/// Refused, or a scene that can be traced, committed and made anew.
void load_mutated(Case& c, const Bytes& bytes) {
    const SealedFile sealed(bytes);
    std::optional<RdxScene> file;
    try {
        file = rdx::parse_scene("attack.rdx", sealed.view, sealed.owner);
    } catch (const InputError& error) {
        expect_refusal(c, error, scene_sections());
        return;
    }
    const std::string name = "attack.rdx";
    const Tables tables(name, sealed);
    const std::vector<Ray> rays = any_rays(c.random, tables.flat(), 24);
    SceneJudge judge(c, "files/mutated scenes that loaded");
    const Scene anew = tables.made_anew();
    if (references_of(file->scene) == references_of(anew))
        judge.compare(file->scene, anew, rays);
    else
        judge.bear(file->scene, rays);
    SceneOptions options = file->options;
    options.threads = 1;
    c.expect(file->scene.commit(options).trees_built == 0, "files/mutated scenes that loaded",
             "a commit of a loaded scene builds trees");
}

}  // namespace

void attack_scene_file(Case& c) {
    const Scene scene = any_scene(c.random);
    const ScratchFile file;
    CameraSet cameras;
    cameras.cameras.resize(c.random.below(3));
    save_rdx(file.path(), scene, "attack", cameras);
    const Bytes sound = file.bytes();
    {
        const RdxScene back = load_rdx_scene(file.path());
        const SealedFile sealed(sound);
        const std::string name = "attack.rdx";
        const std::vector<Ray> rays = any_rays(c.random, Tables(name, sealed).flat(), 100);
        SceneJudge(c, "files/saved scenes").compare(back.scene, scene, rays);
    }
    const std::vector<Stretch> stretches = stretches_of(sound);
    constexpr int mutations = 100;
    for (int i = 0; i < mutations; ++i) load_mutated(c, mutated(c.random, sound, stretches));
}

}  // namespace raydix::attack
