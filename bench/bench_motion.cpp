// What does motion cost? A refit beside Embree's of the same mesh, in one run, in turns (A B A B).
// Hits are compared first. Wall-clock and processor time in a JSON line.
#include <fmt/format.h>
#include <raydix/bvh.h>
#include <raydix/machine.h>
#include <raydix/raydix.h>
#include <raydix/refit.h>
#include <raydix/trace.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "embree_api.h"
#include "work_times.h"

namespace {

using namespace raydix;
using bench::spread_json;
using bench::time_of;
using bench::Times;
using Json = nlohmann::ordered_json;

struct Options {
    std::string scene = "builtin:figure?triangles=1000000", builder = "ploc";
    int threads = 2, repeat = 5;
};

Json both_spreads(const std::vector<Times>& times) {
    return {{"wall_ms", spread_json(times, &Times::wall)},
            {"cpu_ms", spread_json(times, &Times::cpu)}};
}

/// A scene of one geometry that is refitted when its vertices move.
class EmbreeRefit {
public:
    EmbreeRefit(const Mesh& mesh, int threads)
        : device_(rtcNewDevice(("threads=" + std::to_string(threads)).c_str())),
          scene_(rtcNewScene(device_)),
          geometry_(rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE)) {
        // Only scenes of low quality keep a tree for each geometry, which alone can be refitted.
        rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
        rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
        rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   mesh.vertices.data(), 0, sizeof(Vec3), mesh.vertices.size() - 1);
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                   mesh.triangles.data(), 0, sizeof(Triangle),
                                   mesh.triangles.size());
        rtcCommitGeometry(geometry_);
        rtcAttachGeometry(scene_, geometry_);
        rtcCommitScene(scene_);
    }
    ~EmbreeRefit() {
        rtcReleaseGeometry(geometry_);
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    EmbreeRefit(const EmbreeRefit&) = delete;
    EmbreeRefit& operator=(const EmbreeRefit&) = delete;

    void refit() {
        rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_);
        rtcCommitScene(scene_);
        if (rtcGetDeviceError(device_) != RTC_ERROR_NONE) throw InputError("Embree failed");
    }
    float hit(const Ray& ray) {
        RTCRayHit query{};
        query.ray = {ray.origin.x,
                     ray.origin.y,
                     ray.origin.z,
                     ray.tmin,
                     ray.direction.x,
                     ray.direction.y,
                     ray.direction.z,
                     0.0f,
                     ray.tmax,
                     0xFFFFFFFFu,
                     0,
                     0};
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        raydix::bench::EmbreeQuery context(false);
        raydix::bench::intersect(nullptr, scene_, context, query);
        return query.hit.geomID == RTC_INVALID_GEOMETRY_ID ? infinity : query.ray.tfar;
    }

private:
    RTCDevice device_;
    RTCScene scene_;
    RTCGeometry geometry_;
};

/// Twisted by so much; the last vertex is Embree's to read past the end.
void twist(const Mesh& from, float by, Mesh& to) {
    for (std::size_t i = 0; i < from.vertices.size(); ++i) {
        const Vec3 p = from.vertices[i];
        const float angle = by * p.y, c = std::cos(angle), s = std::sin(angle);
        to.vertices[i] = {c * p.x - s * p.z, p.y, s * p.x + c * p.z};
    }
}

std::vector<Ray> some_rays(const Aabb& box) {
    std::mt19937_64 random(1);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const auto at = [](float lo, float hi, float s) { return lo + s * (hi - lo); };
    std::vector<Ray> rays(10'000);
    for (Ray& ray : rays) {
        const Vec3 to{at(box.lo.x, box.hi.x, unit()), at(box.lo.y, box.hi.y, unit()),
                      at(box.lo.z, box.hi.z, unit())};
        ray.origin = {box.lo.x - 1, box.hi.y + 1, at(box.lo.z, box.hi.z, unit())};
        ray.direction = {to.x - ray.origin.x, to.y - ray.origin.y, to.z - ray.origin.z};
    }
    return rays;
}

void compare_hits(const Bvh& ours, const Bvh& fresh, EmbreeRefit& embree) {
    std::size_t differ = 0, far = 0, hits = 0;
    for (const Ray& ray : some_rays(fresh.bounds())) {
        const Hit a = closest_hit(ours, ray), b = closest_hit(fresh, ray);
        const float t = embree.hit(ray);
        differ += a.t != b.t || a.prim != b.prim;
        far += a.hit() != (t < infinity) || (a.hit() && std::fabs(a.t - t) > 1e-4f * t);
        hits += a.hit();
    }
    if (differ != 0 || far > 10 || hits == 0)
        throw InputError(fmt::format("{} hits differ from a new tree's, {} from Embree's, of {}",
                                     differ, far, hits));
}

Json head(const char* question, const Options& options) {
    return {{"bench", question},
            {"cpu", machine_info().cpu},
            {"threads", options.threads},
            {"repeat", options.repeat}};
}

void run_refit(const Options& options) {
    Mesh still = load_flat_model(options.scene).mesh();
    still.vertices.push_back({});  // Embree reads 16 bytes a vertex
    Mesh mesh = still;
    const MeshView view(std::span(mesh.vertices).first(mesh.vertices.size() - 1), mesh.triangles);
    const BuildOptions build{.builder = builder_from_name(options.builder),
                             .threads = options.threads};
    Bvh bvh = build_bvh(view, build);
    const Refitter refitter(bvh);
    EmbreeRefit embree(mesh, options.threads);
    std::vector<Times> ours, theirs;
    RefitQuality quality;
    for (int i = 0; i <= options.repeat; ++i) {
        twist(still, 0.1f * float(i + 1), mesh);
        const Times a = time_of([&] { quality = refitter.refit(bvh, view, options.threads); });
        const Times b = time_of([&] { embree.refit(); });
        if (i == 0) {
            compare_hits(bvh, build_bvh(view, build), embree);
        } else {
            ours.push_back(a);
            theirs.push_back(b);
        }
    }
    Json line = head("refit", options);
    line["scene"] = options.scene;
    line["triangles"] = mesh.triangles.size();
    line["builder"] = options.builder;
    line["sah_ratio"] = quality.ratio;
    line["refit"] = both_spreads(ours);
    line["embree"] = both_spreads(theirs);
    fmt::print("{}\n", line.dump());
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Refit beside Embree's"};
    Options options;
    app.add_option("--scene", options.scene, "a mesh")->capture_default_str();
    app.add_option("--builder", options.builder, "of the tree")->capture_default_str();
    app.add_option("--threads", options.threads, "of both")->capture_default_str();
    app.add_option("--repeat", options.repeat, "turns after the first")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try {
        run_refit(options);
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_motion: {}\n", error.what());
        return 1;
    }
    return 0;
}
