// Embree as a judge. Triangles without area, which Embree may or may not report, are not given to
// it.
#include "support/oracle.h"

#ifdef RAYDIX_EMBREE
#include <embree3/rtcore.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#endif

namespace raydix::test {

#ifdef RAYDIX_EMBREE

struct EmbreeOracle::State {
    RTCDevice device = nullptr;
    RTCScene scene = nullptr;
    std::vector<std::uint32_t> prims;  // Embree's triangle -> the mesh's

    ~State() {
        if (scene != nullptr) rtcReleaseScene(scene);
        if (device != nullptr) rtcReleaseDevice(device);
    }
};

bool EmbreeOracle::available() { return true; }

EmbreeOracle::EmbreeOracle(const MeshView& mesh) : state_(std::make_unique<State>()) {
    State& s = *state_;
    s.device = rtcNewDevice("threads=1,set_affinity=0");
    if (s.device == nullptr) throw std::runtime_error("Embree gave no device");
    s.scene = rtcNewScene(s.device);
    rtcSetSceneFlags(s.scene, RTC_SCENE_FLAG_ROBUST);
    std::vector<Triangle> kept;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        if (!has_area(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]])) continue;
        kept.push_back(t);
        s.prims.push_back(i);
    }
    const RTCGeometry geometry = rtcNewGeometry(s.device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* vertices =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Vec3), std::max<std::size_t>(mesh.vertices.size(), 1));
    void* indices =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                sizeof(Triangle), std::max<std::size_t>(kept.size(), 1));
    std::memcpy(vertices, mesh.vertices.data(), mesh.vertices.size_bytes());
    std::memcpy(indices, kept.data(), kept.size() * sizeof(Triangle));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(s.scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(s.scene);
    if (const RTCError error = rtcGetDeviceError(s.device); error != RTC_ERROR_NONE)
        throw std::runtime_error("Embree error " + std::to_string(error));
}

EmbreeOracle::~EmbreeOracle() = default;

std::vector<Hit> EmbreeOracle::closest(std::span<const Ray> rays) const {
    std::vector<Hit> hits(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Ray& ray = rays[i];
        RTCRayHit query{};
        query.ray.org_x = ray.origin.x;
        query.ray.org_y = ray.origin.y;
        query.ray.org_z = ray.origin.z;
        query.ray.dir_x = ray.direction.x;
        query.ray.dir_y = ray.direction.y;
        query.ray.dir_z = ray.direction.z;
        query.ray.tnear = std::max(ray.tmin, 0.0f);
        query.ray.tfar = ray.tmax;
        query.ray.mask = ~0u;
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        rtcIntersect1(state_->scene, &context, &query);
        if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID)
            hits[i] = hit_of_tree(
                {query.ray.tfar, state_->prims[query.hit.primID], query.hit.u, query.hit.v});
    }
    return hits;
}

#else

struct EmbreeOracle::State {};
bool EmbreeOracle::available() { return false; }
EmbreeOracle::EmbreeOracle(const MeshView&) {}
EmbreeOracle::~EmbreeOracle() = default;
std::vector<Hit> EmbreeOracle::closest(std::span<const Ray> rays) const {
    return std::vector<Hit>(rays.size());
}

#endif

}  // namespace raydix::test
