// All hits by Embree's filter functions, and closest points by rtcPointQuery.
#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "embree_kinds.h"
#include "embree_trace.h"
#include "scene_peers.h"
#include "triangle_point.h"

namespace raydix::bench {
namespace {

struct Gathered {
    std::uint32_t ray;  // of its block
    Hit hit;

    friend bool operator<(const Gathered& a, const Gathered& b) {
        if (a.ray != b.ray) return a.ray < b.ray;
        return a.hit.t != b.hit.t ? a.hit.t < b.hit.t : a.hit.prim < b.hit.prim;
    }
};

/// What the packet that this thread traces has met.
thread_local std::vector<Gathered>* gathered = nullptr;

/// Takes every hit down and refuses it, so that the ray goes on.
void gather(const RTCFilterFunctionNArguments* arguments) {
    const unsigned n = arguments->N;
    for (unsigned i = 0; i < n; ++i) {
        if (arguments->valid[i] == 0) continue;
        gathered->push_back(
            {RTCRayN_id(arguments->ray, n, i),
             {RTCRayN_tfar(arguments->ray, n, i), RTCHitN_primID(arguments->hit, n, i),
              RTCHitN_u(arguments->hit, n, i), RTCHitN_v(arguments->hit, n, i)}});
        arguments->valid[i] = 0;
    }
}

/// Rows of one block of rays: those of its ray i end at ends[i].
struct BlockRows {
    std::vector<Gathered> hits;
    std::vector<std::uint32_t> ends;
};

template <int Width>
void gather_block(RTCScene scene, bool coherent, std::span<const Ray> rays, BlockRows& rows) {
    EmbreeQuery query(coherent);
    typename detail::EmbreeTypes<Width>::RayHits packet{};
    alignas(64) int valid[Width];
    rows.hits.clear();
    rows.ends.assign(rays.size(), 0);
    gathered = &rows.hits;
    for (std::size_t i = 0; i < rays.size(); i += Width) {
        const std::size_t count = std::min<std::size_t>(Width, rays.size() - i),
                          before = rows.hits.size();
        if constexpr (Width == 1) {
            detail::set_ray(packet.ray, rays[i]);
            packet.ray.mask = ~0u;
            packet.ray.id = static_cast<unsigned>(i);
            packet.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        } else {
            detail::set_rays(packet.ray, &rays[i], count);
            for (int k = 0; k < Width; ++k) {
                packet.ray.mask[k] = ~0u;
                packet.ray.id[k] = static_cast<unsigned>(i) + static_cast<unsigned>(k);
                packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
                valid[k] = static_cast<std::size_t>(k) < count ? -1 : 0;
            }
        }
        intersect(valid, scene, query, packet);
        std::sort(rows.hits.begin() + static_cast<std::ptrdiff_t>(before), rows.hits.end());
    }
    // Trees with split triangles, and filters by their own rules, may tell of a hit twice.
    const auto same = [](const Gathered& a, const Gathered& b) {
        return a.ray == b.ray && a.hit.t == b.hit.t && a.hit.prim == b.hit.prim;
    };
    rows.hits.erase(std::unique(rows.hits.begin(), rows.hits.end(), same), rows.hits.end());
    for (const Gathered& hit : rows.hits) ++rows.ends[hit.ray];
    for (std::size_t i = 1; i < rows.ends.size(); ++i) rows.ends[i] += rows.ends[i - 1];
}

/// Rows stay in their blocks, which spares Embree the copy into one array that ours makes.
class EmbreeAllHits : public AllHitsSide {
public:
    EmbreeAllHits(const EmbreeKind& kind, const Mesh& mesh, int threads)
        : kind_(kind),
          threads_(threads),
          device_(threads),
          scene_(device_, kind.quality, kind.flags) {
        add_mesh(scene_, mesh, [](RTCGeometry geometry) {
            rtcSetGeometryIntersectFilterFunction(geometry, gather);
        });
        scene_.commit();
    }

    void take(std::span<const Ray> rays) override {
        rays_ = rays;
        blocks_.resize((rays.size() + rays_of_a_block - 1) / rays_of_a_block);
    }
    std::vector<SideMode> modes() override {
        std::vector<SideMode> modes;
        for (const EmbreeMode mode : embree_modes) {
            modes.push_back({.side = kind_.name, .name = mode.name(), .single = mode.single()});
            modes.back().closest = [this, mode] {
                with_threads(threads_, [&] { gather_all(mode); });
            };
        }
        return modes;
    }
    std::vector<float> distances(std::size_t ray) const override {
        const BlockRows& rows = blocks_[ray / rays_of_a_block];
        const std::size_t i = ray % rays_of_a_block;
        std::vector<float> row;
        for (std::size_t k = i == 0 ? 0 : rows.ends[i - 1]; k < rows.ends[i]; ++k)
            row.push_back(rows.hits[k].hit.t);
        return row;
    }

private:
    void gather_all(EmbreeMode mode) {
        detail::for_each_ray_block(mode.width, rays_.size(),
                                   [&](auto width, std::size_t begin, std::size_t end) {
                                       gather_block<width()>(scene_.scene(), mode.coherent,
                                                             rays_.subspan(begin, end - begin),
                                                             blocks_[begin / rays_of_a_block]);
                                   });
    }

    EmbreeKind kind_;
    int threads_;
    EmbreeDevice device_;
    EmbreeGroup scene_;
    std::span<const Ray> rays_;
    std::vector<BlockRows> blocks_;
};

struct Nearest {
    const Mesh* mesh;
    Vec3 position{infinity, infinity, infinity};
    std::uint32_t prim = no_primitive;
};

bool ask_triangle(RTCPointQueryFunctionArguments* arguments) {
    auto& nearest = *static_cast<Nearest*>(arguments->userPtr);
    RTCPointQuery& query = *arguments->query;
    const Triangle& t = nearest.mesh->triangles[arguments->primID];
    const std::vector<Vec3>& v = nearest.mesh->vertices;
    const Vec3 q{query.x, query.y, query.z},
        position = point_of_triangle(v[t[0]], v[t[1]], v[t[2]], q), off = position - q;
    const float distance = std::sqrt(dot(off, off));
    if (!(distance < query.radius)) return false;
    query.radius = distance;
    nearest.position = position;
    nearest.prim = arguments->primID;
    return true;  // the radius has changed
}

class EmbreeClosestPoints : public ClosestSide {
public:
    EmbreeClosestPoints(const EmbreeKind& kind, const Mesh& mesh, int threads)
        : kind_(kind),
          threads_(threads),
          mesh_(mesh),
          device_(threads),
          scene_(device_, kind.quality, kind.flags) {
        add_mesh(scene_, mesh);
        scene_.commit();
    }

    void take(std::span<const Vec3> queries) override {
        queries_ = queries;
        found_.assign(queries.size(), {&mesh_});
        radii_.resize(queries.size());
    }
    std::vector<SideMode> modes() override {
        SideMode single{.side = kind_.name, .name = "rtcPointQuery", .single = true};
        single.closest = [this] {
            one_by_one(queries_.size(), threads_, [&](std::size_t i) { ask(i); });
        };
        return {single};
    }
    float distance(std::size_t query) const override { return radii_[query]; }

private:
    void ask(std::size_t i) {
        RTCPointQuery query{queries_[i].x, queries_[i].y, queries_[i].z, 0.0f, infinity};
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(scene_.scene(), &query, &context, ask_triangle, &found_[i]);
        radii_[i] = query.radius;
    }

    EmbreeKind kind_;
    int threads_;
    const Mesh& mesh_;
    EmbreeDevice device_;
    EmbreeGroup scene_;
    std::span<const Vec3> queries_;
    std::vector<Nearest> found_;
    std::vector<float> radii_;
};

}  // namespace

std::vector<std::unique_ptr<AllHitsSide>> embree_all_hits(const Mesh& mesh,
                                                          const PeerOptions& options) {
    std::vector<std::unique_ptr<AllHitsSide>> sides;
    for (const EmbreeKind& kind : embree_kinds(options.quality))
        if (!kind.robust)
            sides.push_back(std::make_unique<EmbreeAllHits>(kind, mesh, options.threads));
    return sides;
}

std::vector<std::unique_ptr<ClosestSide>> embree_closest_points(const Mesh& mesh,
                                                                const PeerOptions& options) {
    std::vector<std::unique_ptr<ClosestSide>> sides;
    for (const EmbreeKind& kind : embree_kinds(options.quality))
        if (!kind.robust)
            sides.push_back(std::make_unique<EmbreeClosestPoints>(kind, mesh, options.threads));
    return sides;
}

}  // namespace raydix::bench
