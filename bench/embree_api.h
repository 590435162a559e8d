// What differs between Embree 3 and 4: the header's name, and how a call is told about coherence.
// RAYDIX_EMBREE_MAJOR comes from CMake, which knows the library that is linked.
#pragma once

#include <string>

#if RAYDIX_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace raydix::bench {

#if RAYDIX_EMBREE_MAJOR >= 4

struct EmbreeQuery {
    RTCIntersectArguments closest;
    RTCOccludedArguments any;

    explicit EmbreeQuery(bool coherent) {
        rtcInitIntersectArguments(&closest);
        rtcInitOccludedArguments(&any);
        closest.flags = any.flags =
            coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    }
};

inline void intersect(const int*, RTCScene scene, EmbreeQuery& query, RTCRayHit& rays) {
    rtcIntersect1(scene, &rays, &query.closest);
}
inline void intersect(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRayHit8& rays) {
    rtcIntersect8(valid, scene, &rays, &query.closest);
}
inline void intersect(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &rays, &query.closest);
}
inline void occluded(const int*, RTCScene scene, EmbreeQuery& query, RTCRay& rays) {
    rtcOccluded1(scene, &rays, &query.any);
}
inline void occluded(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRay8& rays) {
    rtcOccluded8(valid, scene, &rays, &query.any);
}
inline void occluded(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRay16& rays) {
    rtcOccluded16(valid, scene, &rays, &query.any);
}

#else

struct EmbreeQuery {
    RTCIntersectContext context;

    explicit EmbreeQuery(bool coherent) {
        rtcInitIntersectContext(&context);
        context.flags =
            coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    }
};

inline void intersect(const int*, RTCScene scene, EmbreeQuery& query, RTCRayHit& rays) {
    rtcIntersect1(scene, &query.context, &rays);
}
inline void intersect(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRayHit8& rays) {
    rtcIntersect8(valid, scene, &query.context, &rays);
}
inline void intersect(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &query.context, &rays);
}
inline void occluded(const int*, RTCScene scene, EmbreeQuery& query, RTCRay& rays) {
    rtcOccluded1(scene, &query.context, &rays);
}
inline void occluded(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRay8& rays) {
    rtcOccluded8(valid, scene, &query.context, &rays);
}
inline void occluded(const int* valid, RTCScene scene, EmbreeQuery& query, RTCRay16& rays) {
    rtcOccluded16(valid, scene, &query.context, &rays);
}

#endif

/// "3.13.5", of the library that runs.
inline std::string embree_version() {
    const RTCDevice device = rtcNewDevice("threads=1");
    const auto part = [device](RTCDeviceProperty property) {
        return std::to_string(rtcGetDeviceProperty(device, property));
    };
    const std::string version = part(RTC_DEVICE_PROPERTY_VERSION_MAJOR) + "." +
                                part(RTC_DEVICE_PROPERTY_VERSION_MINOR) + "." +
                                part(RTC_DEVICE_PROPERTY_VERSION_PATCH);
    rtcReleaseDevice(device);
    return version;
}

}  // namespace raydix::bench
