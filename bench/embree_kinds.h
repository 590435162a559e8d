// Which of Embree's trees stand beside ours of a quality, and meshes in them.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include "embree_owned.h"

namespace raydix::bench {

struct EmbreeKind {
    std::string name;
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    RTCSceneFlags flags = RTC_SCENE_FLAG_NONE;
    bool robust = false;
};

inline std::vector<EmbreeKind> embree_kinds(Quality quality) {
    std::vector<EmbreeKind> kinds;
    const auto add = [&](const std::string& name, RTCBuildQuality of_tree) {
        kinds.push_back({"embree " + name, of_tree, RTC_SCENE_FLAG_NONE, false});
        kinds.push_back({"embree " + name + "+robust", of_tree, RTC_SCENE_FLAG_ROBUST, true});
    };
    if (quality == Quality::fast) add("low", RTC_BUILD_QUALITY_LOW);
    if (quality != Quality::fast) add("medium", RTC_BUILD_QUALITY_MEDIUM);
    if (quality == Quality::high) add("high", RTC_BUILD_QUALITY_HIGH);
    return kinds;
}

/// Shares the mesh's arrays, which must outlive the group; the vertices have room for one more.
/// describe(geometry) adds what else there is to it.
template <class Describe>
void add_mesh(EmbreeGroup& group, const Mesh& mesh, const Describe& describe) {
    group.add(RTC_GEOMETRY_TYPE_TRIANGLE, [&](RTCGeometry geometry) {
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   mesh.vertices.data(), 0, sizeof(Vec3), mesh.vertices.size());
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                   mesh.triangles.data(), 0, sizeof(Triangle),
                                   mesh.triangles.size());
        describe(geometry);
    });
}
inline void add_mesh(EmbreeGroup& group, const Mesh& mesh) {
    add_mesh(group, mesh, [](RTCGeometry) {});
}

}  // namespace raydix::bench
