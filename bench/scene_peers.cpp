// Rays through Embree's scenes.
#include "scene_peers.h"

#include <algorithm>

#include "embree_kinds.h"
#include "embree_owned.h"
#include "embree_trace.h"

namespace raydix::bench {
namespace {

/// Rays through one committed scene. Out: Hit, or PlacedHit for scenes of instances.
template <class Out>
class EmbreeRays : public RaySide {
public:
    EmbreeRays(const EmbreeKind& kind, int threads)
        : kind_(kind), threads_(threads), device_(threads) {}

    [[nodiscard]] const EmbreeDevice& device() const { return device_; }
    /// The last one is the scene that rays go through.
    EmbreeGroup& add_group() {
        groups_.emplace_back(device_, kind_.quality, kind_.flags);
        return groups_.back();
    }
    [[nodiscard]] const EmbreeGroup& group(std::size_t i) const { return groups_[i]; }
    [[nodiscard]] EmbreeGroup& scene() { return groups_.back(); }

    void take(std::span<const Ray> rays) override {
        rays_ = rays;
        hits_.resize(rays.size());
        found_.resize(rays.size());
    }
    std::vector<SideMode> modes() override {
        std::vector<SideMode> modes;
        for (const EmbreeMode mode : embree_modes) {
            if (kind_.robust && !mode.single()) continue;
            modes.push_back({.side = kind_.name,
                             .name = mode.name(),
                             .single = mode.single(),
                             .robust = kind_.robust});
            modes.back().closest = [this, mode] {
                with_threads(threads_,
                             [&] { trace_embree<Out>(scene().scene(), mode, rays_, hits_); });
            };
            // Embree 3.13.5 does not come back from rtcOccluded16 with the coherent flag on scenes
            // of instances: its own loop goes on forever.
            if (std::is_same_v<Out, PlacedHit> && mode.width == 16 && mode.coherent) continue;
            modes.back().any = [this, mode] {
                with_threads(threads_,
                             [&] { trace_any_embree(scene().scene(), mode, rays_, found_); });
            };
        }
        return modes;
    }
    PlacedHit hit(std::size_t ray) const override {
        const Out& hit = hits_[ray];
        if (!hit.hit()) return {};
        if constexpr (std::is_same_v<Out, PlacedHit>)
            return hit;
        else
            return {hit.t, hit.prim, hit.u, hit.v, 0, 0};
    }
    bool found(std::size_t ray) const override { return found_[ray] != 0; }

private:
    EmbreeKind kind_;
    int threads_;
    EmbreeDevice device_;
    std::vector<EmbreeGroup> groups_;
    std::span<const Ray> rays_;
    std::vector<Out> hits_;
    std::vector<std::uint8_t> found_;
};

/// describe(side) fills the side's groups.
template <class Out, class Describe>
EmbreeSides sides_of(const PeerOptions& options, const Describe& describe) {
    EmbreeSides sides;
    for (const EmbreeKind& kind : embree_kinds(options.quality)) {
        auto side = std::make_unique<EmbreeRays<Out>>(kind, options.threads);
        describe(*side);
        sides.push_back(std::move(side));
    }
    return sides;
}

/// Groups of one mesh each, then the scene with all leaves.
void place_leaves(EmbreeRays<PlacedHit>& side, const PlacedScene& scene) {
    for (const SharedMesh& mesh : scene.meshes) {
        EmbreeGroup& group = side.add_group();
        add_mesh(group, *mesh);
        group.commit();
    }
    EmbreeGroup& world = side.add_group();
    for (const PlacedLeaf& leaf : leaves_of(scene))
        world.add(RTC_GEOMETRY_TYPE_INSTANCE, [&](RTCGeometry geometry) {
            rtcSetGeometryInstancedScene(geometry, side.group(leaf.mesh).scene());
            rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR,
                                    leaf.to_world.data());
        });
    world.commit();
}

/// The filter function as Embree takes it: with the function to ask as the geometry's own pointer.
void ask_filter(const RTCFilterFunctionNArguments* arguments) {
    const auto accept = reinterpret_cast<AcceptPrimitive>(arguments->geometryUserPtr);
    for (unsigned i = 0; i < arguments->N; ++i)
        if (arguments->valid[i] != 0 && !accept(RTCHitN_primID(arguments->hit, arguments->N, i)))
            arguments->valid[i] = 0;
}

class EmbreeMoving : public MovingSide {
public:
    EmbreeMoving(const EmbreeKind& kind, const PlacedScene& scene, int threads)
        : name_(kind.name), rays_(kind, threads) {
        place_leaves(rays_, scene);
    }
    std::string name() const override { return name_; }
    void move(std::span<const Affine> to_world) override {
        const EmbreeGroup& world = rays_.scene();
        for (std::size_t i = 0; i < to_world.size(); ++i) {
            rtcSetGeometryTransform(world.geometry(i), 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR,
                                    to_world[i].data());
            rtcCommitGeometry(world.geometry(i));
        }
    }
    void commit() override { rays_.scene().commit(); }
    RaySide& rays() override { return rays_; }

private:
    std::string name_;
    EmbreeRays<PlacedHit> rays_;
};

class EmbreeMovingMesh : public FrameSide {
public:
    /// `refits`: the geometry has the quality of that name. Only scenes of low quality keep a tree
    /// for each geometry, which alone can be refitted.
    EmbreeMovingMesh(const EmbreeKind& kind, bool refits, const Mesh& mesh, int threads)
        : name_(kind.name), mesh_(mesh), rays_(kind, threads) {
        mesh_.vertices.reserve(mesh.vertices.size() + 1);  // Embree reads 16 bytes a vertex
        EmbreeGroup& scene = rays_.add_group();
        add_mesh(scene, mesh_, [&](RTCGeometry geometry) {
            if (refits) rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
        });
        scene.commit();
    }
    std::string name() const override { return name_; }
    void move(std::span<const Vec3> places) override {
        std::copy(places.begin(), places.end(), mesh_.vertices.begin());
    }
    void commit() override {
        rtcUpdateGeometryBuffer(rays_.scene().geometry(0), RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(rays_.scene().geometry(0));
        rays_.scene().commit();
    }
    RaySide& rays() override { return rays_; }

private:
    std::string name_;
    Mesh mesh_;
    EmbreeRays<Hit> rays_;
};

void disc_bounds(const RTCBoundsFunctionArguments* arguments) {
    const auto* discs = static_cast<const Disc*>(arguments->geometryUserPtr);
    const Aabb box = box_of(discs[arguments->primID]);
    *arguments->bounds_o = {box.lo.x, box.lo.y, box.lo.z, 0, box.hi.x, box.hi.y, box.hi.z, 0};
}

/// One lane of a packet of N rays, as the C function takes it.
bool hit_disc_of_lane(const void* discs, unsigned prim, RTCRayN* rays, unsigned n, unsigned i,
                      float* t) {
    const float origin[] = {RTCRayN_org_x(rays, n, i), RTCRayN_org_y(rays, n, i),
                            RTCRayN_org_z(rays, n, i)};
    const float direction[] = {RTCRayN_dir_x(rays, n, i), RTCRayN_dir_y(rays, n, i),
                               RTCRayN_dir_z(rays, n, i)};
    return raydix_bench_hit_disc(static_cast<const Disc*>(discs), prim, origin, direction,
                                 RTCRayN_tnear(rays, n, i), RTCRayN_tfar(rays, n, i), t) != 0;
}

void disc_intersect(const RTCIntersectFunctionNArguments* arguments) {
    const unsigned n = arguments->N;
    RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, n);
    RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, n);
    for (unsigned i = 0; i < n; ++i) {
        float t = 0;
        if (arguments->valid[i] == 0 ||
            !hit_disc_of_lane(arguments->geometryUserPtr, arguments->primID, rays, n, i, &t))
            continue;
        RTCRayN_tfar(rays, n, i) = t;
        RTCHitN_u(hits, n, i) = 0;
        RTCHitN_v(hits, n, i) = 0;
        RTCHitN_primID(hits, n, i) = arguments->primID;
        RTCHitN_geomID(hits, n, i) = arguments->geomID;
        RTCHitN_instID(hits, n, i, 0) = arguments->context->instID[0];
    }
}

void disc_occluded(const RTCOccludedFunctionNArguments* arguments) {
    const unsigned n = arguments->N;
    for (unsigned i = 0; i < n; ++i) {
        float t = 0;
        if (arguments->valid[i] != 0 &&
            hit_disc_of_lane(arguments->geometryUserPtr, arguments->primID, arguments->ray, n, i,
                             &t))
            RTCRayN_tfar(arguments->ray, n, i) = -infinity;
    }
}

}  // namespace

EmbreeSides embree_meshes(const Mesh& mesh, const PeerOptions& options) {
    return sides_of<Hit>(options, [&](EmbreeRays<Hit>& side) {
        EmbreeGroup& scene = side.add_group();
        add_mesh(scene, mesh);
        scene.commit();
    });
}

EmbreeSides embree_filtered_meshes(const Mesh& mesh, AcceptPrimitive accept,
                                   const PeerOptions& options) {
    return sides_of<Hit>(options, [&](EmbreeRays<Hit>& side) {
        EmbreeGroup& scene = side.add_group();
        add_mesh(scene, mesh, [&](RTCGeometry geometry) {
            rtcSetGeometryUserData(geometry, reinterpret_cast<void*>(accept));
            rtcSetGeometryIntersectFilterFunction(geometry, ask_filter);
            rtcSetGeometryOccludedFilterFunction(geometry, ask_filter);
        });
        scene.commit();
    });
}

EmbreeSides embree_instances(const PlacedScene& scene, const PeerOptions& options) {
    return sides_of<PlacedHit>(options,
                               [&](EmbreeRays<PlacedHit>& side) { place_leaves(side, scene); });
}

EmbreeSides embree_spheres(std::span<const Sphere> spheres, const PeerOptions& options) {
    static_assert(sizeof(Sphere) == 4 * sizeof(float));
    return sides_of<Hit>(options, [&](EmbreeRays<Hit>& side) {
        EmbreeGroup& scene = side.add_group();
        scene.add(RTC_GEOMETRY_TYPE_SPHERE_POINT, [&](RTCGeometry geometry) {
            rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4,
                                       spheres.data(), 0, sizeof(Sphere), spheres.size());
        });
        scene.commit();
    });
}

EmbreeSides embree_discs(std::span<const Disc> discs, const PeerOptions& options) {
    return sides_of<Hit>(options, [&](EmbreeRays<Hit>& side) {
        EmbreeGroup& scene = side.add_group();
        scene.add(RTC_GEOMETRY_TYPE_USER, [&](RTCGeometry geometry) {
            rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(discs.size()));
            rtcSetGeometryUserData(geometry, const_cast<Disc*>(discs.data()));
            rtcSetGeometryBoundsFunction(geometry, disc_bounds, nullptr);
            rtcSetGeometryIntersectFunction(geometry, disc_intersect);
            rtcSetGeometryOccludedFunction(geometry, disc_occluded);
        });
        scene.commit();
    });
}

std::vector<std::unique_ptr<MovingSide>> embree_moving_instances(const PlacedScene& scene,
                                                                 const PeerOptions& options) {
    std::vector<std::unique_ptr<MovingSide>> sides;
    for (const EmbreeKind& kind : embree_kinds(options.quality))
        if (!kind.robust)
            sides.push_back(std::make_unique<EmbreeMoving>(kind, scene, options.threads));
    sides.push_back(std::make_unique<EmbreeMoving>(
        EmbreeKind{"embree low+dynamic", RTC_BUILD_QUALITY_LOW, RTC_SCENE_FLAG_DYNAMIC, false},
        scene, options.threads));
    return sides;
}

std::vector<std::unique_ptr<FrameSide>> embree_moving_mesh(const Mesh& mesh,
                                                           const PeerOptions& options) {
    std::vector<std::unique_ptr<FrameSide>> sides;
    const auto add = [&](const char* name, RTCBuildQuality quality, RTCSceneFlags flags,
                         bool refits) {
        sides.push_back(std::make_unique<EmbreeMovingMesh>(EmbreeKind{name, quality, flags, false},
                                                           refits, mesh, options.threads));
    };
    add("embree refit+dynamic", RTC_BUILD_QUALITY_LOW, RTC_SCENE_FLAG_DYNAMIC, true);
    add("embree low+dynamic", RTC_BUILD_QUALITY_LOW, RTC_SCENE_FLAG_DYNAMIC, false);
    add("embree low", RTC_BUILD_QUALITY_LOW, RTC_SCENE_FLAG_NONE, false);
    add("embree medium", RTC_BUILD_QUALITY_MEDIUM, RTC_SCENE_FLAG_NONE, false);
    return sides;
}

}  // namespace raydix::bench
