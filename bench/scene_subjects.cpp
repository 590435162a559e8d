#include "scene_subjects.h"

#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/trace.h>
#include <raydix/user_geometry.h>
#include <raydix/wide.h>

#include <algorithm>

#include "exec/parallel.h"
#include "one_by_one.h"

namespace raydix::bench {
namespace {

PlacedHit placed(const Hit& hit) {
    if (!hit.hit()) return {};
    return {hit.t, hit.prim, hit.u, hit.v, 0, 0};
}

BuildOptions build_options(const SubjectOptions& options) {
    BuildOptions build = build_options_for(options.quality);
    build.threads = options.threads;
    return build;
}

/// Rays as they are.
struct FloatRays {
    using Ray = raydix::Ray;
    using Hit = raydix::Hit;
    static std::span<const Ray> given(std::span<const Ray> rays) { return rays; }
};

/// The library's own calls on one kind of scene. Calls: given(rays) makes the rays that the calls
/// take; closest(rays, hits, threads), any(rays, found, threads), closest_one(ray), any_one(ray);
/// placed(hit).
template <class Calls>
class OurRays : public RaySide {
public:
    template <class... Arguments>
    OurRays(const SubjectOptions& options, Arguments&&... arguments)
        : threads_(options.threads), calls_(std::forward<Arguments>(arguments)...) {}

    void take(std::span<const raydix::Ray> rays) override {
        rays_ = calls_.given(rays);
        hits_.resize(rays.size());
        found_.resize(rays.size());
    }
    std::vector<SideMode> modes() override {
        SideMode batch{.side = "raydix", .name = "batch", .ours = true};
        batch.closest = [this] { calls_.closest(rays_, hits_, threads_); };
        batch.any = [this] { calls_.any(rays_, found_, threads_); };
        SideMode single{.side = "raydix", .name = "single", .ours = true, .single = true};
        single.closest = [this] {
            one_by_one(rays_.size(), threads_,
                       [&](std::size_t i) { hits_[i] = calls_.closest_one(rays_[i]); });
        };
        single.any = [this] {
            one_by_one(rays_.size(), threads_,
                       [&](std::size_t i) { found_[i] = calls_.any_one(rays_[i]); });
        };
        return {batch, single};
    }
    PlacedHit hit(std::size_t ray) const override { return calls_.placed(hits_[ray]); }
    bool found(std::size_t ray) const override { return found_[ray] != 0; }

    Calls& calls() { return calls_; }

private:
    int threads_;
    Calls calls_;
    decltype(std::declval<Calls>().given({})) rays_;
    std::vector<typename Calls::Hit> hits_;
    std::vector<std::uint8_t> found_;
};

struct MeshCalls : FloatRays {
    WideBvh tree;

    MeshCalls(const Mesh& mesh, const SubjectOptions& options)
        : tree(build_wide_bvh(mesh, build_options(options))) {}
    void closest(std::span<const Ray> rays, std::span<Hit> hits, int threads) const {
        trace(tree, rays, hits, {.threads = threads});
    }
    void any(std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) const {
        trace_any(tree, rays, found, {.threads = threads});
    }
    [[nodiscard]] Hit closest_one(const Ray& ray) const { return closest_hit(tree, ray); }
    [[nodiscard]] bool any_one(const Ray& ray) const { return any_hit(tree, ray); }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const { return bench::placed(hit); }
};

Vec3d widened(Vec3 p) { return {p.x, p.y, p.z}; }

Transform transform_of(const Affine& affine) {
    Transform transform;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) transform.m[r][c] = affine[4 * r + c];
    return transform;
}

SceneOptions scene_options(const SubjectOptions& options) {
    return {.quality = options.quality, .threads = options.threads};
}

/// A mesh in a SceneD.
struct DoubleCalls {
    using Hit = HitD;
    SceneD scene;

    DoubleCalls(const Mesh& mesh, const SubjectOptions& options) {
        MeshD wide;
        for (const Vec3 v : mesh.vertices) wide.vertices.push_back(widened(v));
        wide.triangles = mesh.triangles;
        scene.add(wide);
        scene.commit(scene_options(options));
    }
    static std::vector<RayD> given(std::span<const Ray> rays) {
        std::vector<RayD> wide;
        for (const Ray& ray : rays)
            wide.push_back({widened(ray.origin), ray.tmin, widened(ray.direction), ray.tmax});
        return wide;
    }
    void closest(std::span<const RayD> rays, std::span<HitD> hits, int threads) const {
        trace(scene, rays, hits, {.threads = threads});
    }
    void any(std::span<const RayD> rays, std::span<std::uint8_t> found, int threads) const {
        trace_any(scene, rays, found, {.threads = threads});
    }
    [[nodiscard]] HitD closest_one(const RayD& ray) const { return closest_hit(scene, ray); }
    [[nodiscard]] bool any_one(const RayD& ray) const { return any_hit(scene, ray); }
    [[nodiscard]] PlacedHit placed(const HitD& hit) const {
        if (!hit.hit()) return {};
        return {float(hit.t), hit.prim, float(hit.u), float(hit.v), 0, 0};
    }
};

/// Rays through a Scene.
struct SceneCalls : FloatRays {
    using Hit = raydix::Hit;
    Scene scene;

    void closest(std::span<const Ray> rays, std::span<Hit> hits, int threads) const {
        trace(scene, rays, hits, {.threads = threads});
    }
    void any(std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) const {
        trace_any(scene, rays, found, {.threads = threads});
    }
    [[nodiscard]] Hit closest_one(const Ray& ray) const { return closest_hit(scene, ray); }
    [[nodiscard]] bool any_one(const Ray& ray) const { return any_hit(scene, ray); }
};

struct InstanceCalls : SceneCalls {
    std::vector<std::vector<Placement>> placements;
    std::vector<std::vector<std::uint32_t>> first_leaves;
    std::vector<Scene> meshes, groups;  // groups[0] stays empty: it is `scene`

    InstanceCalls(const PlacedScene& contents, const SubjectOptions& options)
        : placements(contents.groups), first_leaves(first_leaves_of(contents)) {
        for (const SharedMesh& mesh : contents.meshes) {
            meshes.emplace_back().share(*mesh);
            meshes.back().commit(scene_options(options));
        }
        groups.resize(placements.size());
        // Groups come after those that show them.
        for (std::size_t g = placements.size(); g-- > 0;) {
            Scene& into = g == 0 ? scene : groups[g];
            for (const Placement& p : placements[g])
                into.add((p.is_group ? groups : meshes)[p.thing], transform_of(p.to_parent));
            into.commit(scene_options(options));
        }
    }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const {
        if (!hit.hit()) return {};
        std::uint32_t leaf = 0;
        std::size_t group = 0;
        for (const std::uint32_t place : scene.path(hit.instance)) {
            leaf += first_leaves[group][place];
            const Placement& next = placements[group][place];
            if (!next.is_group) break;
            group = next.thing;
        }
        return {hit.t, hit.prim, hit.u, hit.v, 0, leaf};
    }
};

/// Meshes as geometries of one scene. Hits name triangles as in the meshes behind each other.
struct FixedCalls : SceneCalls {
    std::vector<std::uint32_t> first;

    FixedCalls(const std::vector<SharedMesh>& meshes, const SubjectOptions& options) {
        std::uint32_t next = 0;
        for (const SharedMesh& mesh : meshes) {
            scene.share(*mesh);
            first.push_back(next);
            next += static_cast<std::uint32_t>(mesh->triangles.size());
        }
        scene.commit(scene_options(options));
    }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const {
        if (!hit.hit()) return {};
        return {hit.t, first[hit.geometry] + hit.prim, hit.u, hit.v, 0, 0};
    }
};

/// One mesh, of which a function takes triangles away.
struct FilteredCalls : SceneCalls {
    HitFilter filter;

    FilteredCalls(const Mesh& mesh, AcceptPrimitive accept, const SubjectOptions& options)
        : filter([accept](std::size_t, const Ray&, const Hit& hit) { return accept(hit.prim); }) {
        scene.share(mesh);
        scene.commit(scene_options(options));
    }
    void closest(std::span<const Ray> rays, std::span<Hit> hits, int threads) const {
        trace(scene, rays, hits, options(threads));
    }
    void any(std::span<const Ray> rays, std::span<std::uint8_t> found, int threads) const {
        trace_any(scene, rays, found, options(threads));
    }
    [[nodiscard]] Hit closest_one(const Ray& ray) const { return closest_hit(scene, ray, filter); }
    [[nodiscard]] bool any_one(const Ray& ray) const { return any_hit(scene, ray, filter); }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const { return bench::placed(hit); }

private:
    [[nodiscard]] SceneTraceOptions options(int threads) const {
        SceneTraceOptions all;
        all.threads = threads;
        all.filter = filter;
        return all;
    }
};

/// One geometry that is no mesh. Shapes: what Scene::add takes.
template <class Shapes>
struct ShapeCalls : SceneCalls {
    ShapeCalls(const Shapes& shapes, const SubjectOptions& options) {
        scene.add(shapes);
        scene.commit(scene_options(options));
    }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const { return bench::placed(hit); }
};

class OurAllHits : public AllHitsSide {
public:
    OurAllHits(const Mesh& mesh, const SubjectOptions& options) : threads_(options.threads) {
        scene_.share(mesh);
        scene_.commit(scene_options(options));
    }

    void take(std::span<const Ray> rays) override { rays_ = rays; }
    std::vector<SideMode> modes() override {
        SideMode batch{.side = "raydix", .name = "batch", .ours = true};
        batch.closest = [this] { all_ = trace_all(scene_, rays_, {.threads = threads_}); };
        return {batch};
    }
    std::vector<float> distances(std::size_t ray) const override {
        std::vector<float> row;
        for (std::uint64_t k = all_.offsets[ray]; k < all_.offsets[ray + 1]; ++k)
            row.push_back(all_.hits[k].t);
        return row;
    }

private:
    int threads_;
    Scene scene_;
    std::span<const Ray> rays_;
    AllHits all_;
};

class OurClosestPoints : public ClosestSide {
public:
    OurClosestPoints(const Mesh& mesh, const SubjectOptions& options) : threads_(options.threads) {
        scene_.share(mesh);
        scene_.commit(scene_options(options));
    }

    void take(std::span<const Vec3> queries) override {
        queries_ = queries;
        found_.resize(queries.size());
    }
    std::vector<SideMode> modes() override {
        SideMode batch{.side = "raydix", .name = "batch", .ours = true};
        batch.closest = [this] { closest_points(scene_, queries_, found_, {.threads = threads_}); };
        SideMode single{.side = "raydix", .name = "single", .ours = true, .single = true};
        single.closest = [this] {
            one_by_one(queries_.size(), threads_,
                       [&](std::size_t i) { found_[i] = closest_point(scene_, queries_[i]); });
        };
        return {batch, single};
    }
    float distance(std::size_t query) const override { return found_[query].distance; }

private:
    int threads_;
    Scene scene_;
    std::span<const Vec3> queries_;
    std::vector<SceneClosestPoint> found_;
};

class OurMovingInstances : public MovingSide {
public:
    OurMovingInstances(const PlacedScene& scene, const SubjectOptions& options)
        : quality_(options.quality), threads_(options.threads), rays_(options, scene, options) {}

    std::string name() const override { return "raydix"; }
    void move(std::span<const Affine> to_world) override {
        Scene& scene = rays_.calls().scene;
        for (std::uint32_t i = 0; i < to_world.size(); ++i)
            scene.set_transform(i, transform_of(to_world[i]));
    }
    void commit() override {
        rays_.calls().scene.commit(
            {.quality = quality_, .usage = Usage::moving, .threads = threads_});
    }
    RaySide& rays() override { return rays_; }

private:
    Quality quality_;
    int threads_;
    OurRays<InstanceCalls> rays_;
};

/// A mesh that is shared with the scene. The caller's vertices take turns between two arrays, since
/// those of the last commit stay as they are.
struct MovingMeshCalls : SceneCalls {
    std::vector<Triangle> triangles;
    std::array<std::vector<Vec3>, 2> vertices;
    std::size_t now = 0;

    explicit MovingMeshCalls(const Mesh& mesh)
        : triangles(mesh.triangles), vertices{mesh.vertices, mesh.vertices} {
        scene.share(view());
    }
    [[nodiscard]] MeshView view() const { return {vertices[now], triangles}; }
    [[nodiscard]] PlacedHit placed(const Hit& hit) const { return bench::placed(hit); }
};

class OurMovingMesh : public FrameSide {
public:
    OurMovingMesh(const Mesh& mesh, const SubjectOptions& options)
        : quality_(options.quality), threads_(options.threads), rays_(options, mesh) {
        commit();
    }

    std::string name() const override { return "raydix"; }
    void move(std::span<const Vec3> places) override {
        MovingMeshCalls& calls = rays_.calls();
        calls.now = 1 - calls.now;
        std::copy(places.begin(), places.end(), calls.vertices[calls.now].begin());
    }
    void commit() override {
        MovingMeshCalls& calls = rays_.calls();
        with_threads(threads_, [&] { calls.scene.update(0, calls.view()); });
        calls.scene.commit({.quality = quality_, .usage = Usage::moving, .threads = threads_});
    }
    RaySide& rays() override { return rays_; }

private:
    Quality quality_;
    int threads_;
    OurRays<MovingMeshCalls> rays_;
};

}  // namespace

std::unique_ptr<RaySide> our_mesh(const Mesh& mesh, const SubjectOptions& options) {
    return std::make_unique<OurRays<MeshCalls>>(options, mesh, options);
}

std::unique_ptr<RaySide> our_double_mesh(const Mesh& mesh, const SubjectOptions& options) {
    return std::make_unique<OurRays<DoubleCalls>>(options, mesh, options);
}

std::unique_ptr<RaySide> our_instances(const PlacedScene& scene, const SubjectOptions& options) {
    return std::make_unique<OurRays<InstanceCalls>>(options, scene, options);
}

std::unique_ptr<RaySide> our_spheres(std::span<const Sphere> spheres,
                                     const SubjectOptions& options) {
    return std::make_unique<OurRays<ShapeCalls<std::span<const Sphere>>>>(options, spheres,
                                                                          options);
}

std::unique_ptr<RaySide> our_discs(std::span<const Disc> discs, const SubjectOptions& options) {
    std::vector<Aabb> boxes;
    for (const Disc& disc : discs) boxes.push_back(box_of(disc));
    const auto intersect = [discs](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return raydix_bench_hit_disc(discs.data(), prim, &ray.origin.x, &ray.direction.x, ray.tmin,
                                     ray.tmax, &hit.t) != 0;
    };
    return std::make_unique<OurRays<ShapeCalls<UserGeometry>>>(
        options, UserGeometry(boxes, intersect), options);
}

std::unique_ptr<RaySide> our_filtered_mesh(const Mesh& mesh, AcceptPrimitive accept,
                                           const SubjectOptions& options) {
    return std::make_unique<OurRays<FilteredCalls>>(options, mesh, accept, options);
}
std::unique_ptr<RaySide> our_fixed_scene(const std::vector<SharedMesh>& meshes,
                                         const SubjectOptions& options) {
    return std::make_unique<OurRays<FixedCalls>>(options, meshes, options);
}

std::unique_ptr<AllHitsSide> our_all_hits(const Mesh& mesh, const SubjectOptions& options) {
    return std::make_unique<OurAllHits>(mesh, options);
}

std::unique_ptr<ClosestSide> our_closest_points(const Mesh& mesh, const SubjectOptions& options) {
    return std::make_unique<OurClosestPoints>(mesh, options);
}

std::unique_ptr<MovingSide> our_moving_instances(const PlacedScene& scene,
                                                 const SubjectOptions& options) {
    return std::make_unique<OurMovingInstances>(scene, options);
}

std::unique_ptr<FrameSide> our_moving_mesh(const Mesh& mesh, const SubjectOptions& options) {
    return std::make_unique<OurMovingMesh>(mesh, options);
}

}  // namespace raydix::bench
