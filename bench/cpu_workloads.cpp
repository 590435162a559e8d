#include "cpu_workloads.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <raydix/rays.h>
#include <raydix/surface.h>

#include <algorithm>
#include <charconv>
#include <numbers>

#include "base/double3.h"
#include "base/math.h"
#include "cli/simulation.h"
#include "exec/parallel.h"
#include "rays/hemisphere_rays.h"
#include "rays/sampling.h"

namespace raydix::bench {
namespace {

constexpr std::size_t portion_rays = std::size_t{1} << 22;
constexpr std::size_t least_rays_in_calls = std::size_t{1} << 16;  // of NAME@N

/// The protocol's kinds: launches of --launch-rays, of which --sample takes a part.
constexpr const char* launched_kinds[] = {"ao", "diffuse", "diffuse_shuffled"};
constexpr const char* all_kinds[] = {"primary",  "ao",          "diffuse",     "diffuse_shuffled",
                                     "ao_1",     "ao_4",        "diffuse_1",   "diffuse_4",
                                     "bounce_1", "bounce_2",    "bounce_3",    "bounce_4",
                                     "bounce_5", "shadow_lamp", "shadow_area", "lidar",
                                     "random",   "outside"};
constexpr const char* default_calls[] = {
    "primary@64",      "primary@1024", "primary@16384", "diffuse_1@64", "diffuse_1@1024",
    "diffuse_1@16384", "random@64",    "random@1024",   "random@16384", "random@262144"};

/// Each use of chance has numbers of its own.
enum Salt : std::uint64_t { scatter_salt = 1000, lamp_salt, turn_salt, random_salt, outside_salt };

/// Number `k` of element `i`, in [0, 1).
float chance(std::uint64_t seed, std::uint64_t i, std::uint64_t k) {
    return unit_from(hash_of(seed, 8 * i + k));
}

Double3 at(Double3 from, Double3 to, double part) { return from + (to - from) * part; }

Double3 into_box(Double3 p, const Aabb& box, double margin) {
    const auto inside = [margin](double x, double lo, double hi) {
        return std::clamp(x, lo + margin * (hi - lo), hi - margin * (hi - lo));
    };
    return {inside(p.x, box.lo.x, box.hi.x), inside(p.y, box.lo.y, box.hi.y),
            inside(p.z, box.lo.z, box.hi.z)};
}

/// Right, up and forward of a camera, of unit length.
struct CameraAxes {
    Double3 right, up, forward;

    explicit CameraAxes(const Camera& camera) {
        forward = normalized(Double3(camera.target) - Double3(camera.position));
        right = normalized(cross(forward, Double3(camera.up)));
        up = cross(right, forward);
    }
};

Workload workload_from(const std::string& text) {
    Workload workload{text, text.substr(0, text.find('@')), 0};
    const auto wrong = [&](const std::string& what) {
        throw CLI::ValidationError("--workloads", "'" + text + "' " + what);
    };
    if (std::find(std::begin(all_kinds), std::end(all_kinds), workload.kind) == std::end(all_kinds))
        wrong("is not all or one of " + workload_kinds() + ", with @N after it or not");
    if (workload.kind == text) return workload;
    const char* begin = text.data() + workload.kind.size() + 1;
    const char* end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(begin, end, workload.call_rays);
    if (error != std::errc() || rest != end || workload.call_rays == 0 ||
        workload.call_rays > std::size_t{1} << 26)
        wrong("has no number from 1 to 67108864 after @");
    return workload;
}

/// A run of whole calls from the middle of each batch, as many as make least_rays_in_calls. A batch
/// that is shorter than a call is one call.
class CallsOfBatches {
public:
    explicit CallsOfBatches(std::size_t call_rays) : call_rays_(call_rays) {}

    void take(std::span<const Ray> batch) {
        if (!batch.empty()) batches_.emplace_back(batch.begin(), batch.end());
    }

    [[nodiscard]] Portion portion() const {
        const std::size_t wanted = (least_rays_in_calls + call_rays_ - 1) / call_rays_;
        Portion all;
        for (std::size_t b = 0; b < batches_.size(); ++b) {
            const std::vector<Ray>& batch = batches_[b];
            const std::size_t there = batch.size() / call_rays_;
            const std::size_t calls =
                std::min(there, (wanted + batches_.size() - 1) / batches_.size());
            const std::size_t first = (there - calls) / 2 * call_rays_;
            if (calls == 0) add(all, batch);
            for (std::size_t k = 0; k < calls; ++k)
                add(all, std::span(batch).subspan(first + k * call_rays_, call_rays_));
        }
        return all;
    }

private:
    static void add(Portion& portion, std::span<const Ray> call) {
        portion.rays.insert(portion.rays.end(), call.begin(), call.end());
        portion.ends.push_back(portion.rays.size());
    }

    std::size_t call_rays_;
    std::vector<std::vector<Ray>> batches_;
};

}  // namespace

bool Workload::any() const { return kind.starts_with("ao") || kind.starts_with("shadow"); }

std::string workload_kinds() { return fmt::format("{}", fmt::join(all_kinds, ", ")); }

std::vector<Workload> workloads_from(const std::string& names) {
    std::vector<Workload> all;
    if (names == "all") {
        for (const char* kind : all_kinds) all.push_back(workload_from(kind));
        for (const char* calls : default_calls) all.push_back(workload_from(calls));
        return all;
    }
    for (std::size_t begin = 0; begin <= names.size();) {
        const std::size_t end = std::min(names.find(',', begin), names.size());
        all.push_back(workload_from(names.substr(begin, end - begin)));
        begin = end + 1;
    }
    return all;
}

WorkloadRays::WorkloadRays(const CpuBench& options, const Model& model, const Scene& scene)
    : options_(options),
      model_(model),
      scene_(scene),
      box_(scene.bounds()),
      diagonal_(length(Double3(box_.hi) - Double3(box_.lo))),
      cameras_(cli::chosen_cameras(options.launches.camera, model)) {
    const cli::Size size = cli::chosen_size(options.launches, model);
    picture_rays_ = std::size_t{size.width} * size.height * cameras_.size();
    for (const Camera& camera : cameras_) {
        std::vector<std::uint32_t> pixels;
        std::vector<Ray> rays = make_primary_rays(camera, size.width, size.height, &pixels);
        views_.push_back(traced(std::move(rays), std::move(pixels)));
    }
}

void WorkloadRays::for_each(const Workload& workload,
                            const std::function<void(const Portion&, double)>& visit) const {
    if (workload.call_rays != 0) {
        CallsOfBatches calls(workload.call_rays);
        for_each_batch(workload, [&](std::span<const Ray> rays, double) { calls.take(rays); });
        if (const Portion portion = calls.portion(); !portion.rays.empty()) visit(portion, 1.0);
        return;
    }
    Portion portion;
    double done_before = 0;
    const auto send = [&](double done) {
        if (!portion.rays.empty()) visit(portion, done);
        portion = {};
    };
    for_each_batch(workload, [&](std::span<const Ray> batch, double done) {
        if (portion.rays.size() + batch.size() > portion_rays) send(done_before);
        done_before = done;
        if (batch.empty()) return;
        portion.rays.insert(portion.rays.end(), batch.begin(), batch.end());
        portion.ends.push_back(portion.rays.size());
    });
    send(1.0);
}

void WorkloadRays::for_each_batch(const Workload& workload, const VisitBatch& visit) const {
    const std::string& kind = workload.kind;
    if (std::find(std::begin(launched_kinds), std::end(launched_kinds), kind) !=
        std::end(launched_kinds)) {
        const cli::RayLaunches launches(options_.launches, model_, scene_, options_.common);
        launches.for_each(cli::kinds_from(kind).front(),
                          [&](const cli::RayUnit& unit, double done) { visit(unit.rays, done); });
        return;
    }
    if (kind == "random")
        visit(random_rays(workload.call_rays == 0
                              ? picture_rays_
                              : std::max(workload.call_rays, least_rays_in_calls)),
              1.0);
    else if (kind == "outside")
        visit(outside_rays(picture_rays_), 1.0);
    else
        for (std::size_t v = 0; v < views_.size(); ++v)
            visit(view_rays(kind, v), double(v + 1) / double(views_.size()));
}

std::vector<Ray> WorkloadRays::view_rays(const std::string& kind, std::size_t view) const {
    const Wave& primary = views_[view];
    if (kind == "primary") return primary.rays;
    if (kind == "lidar") return lidar_turn(view);
    if (kind.starts_with("shadow")) return lamp_rays(primary, kind == "shadow_area");
    const int number = kind.back() - '0';
    if (kind.starts_with("bounce")) return bounced(primary, number);
    const float tmax = kind.starts_with("ao")
                           ? cli::chosen_ao_radius(options_.launches.ao_radius, model_, box_)
                           : infinity;
    return scattered(primary, static_cast<std::uint32_t>(number), tmax, options_.common.seed);
}

WorkloadRays::Wave WorkloadRays::traced(std::vector<Ray> rays,
                                        std::vector<std::uint32_t> pixels) const {
    Wave wave{std::move(rays), {}, std::move(pixels)};
    wave.hits = trace(scene_, wave.rays, {.threads = options_.common.threads});
    return wave;
}

/// Cosine-weighted about the normals, in the order of the hits; misses give none.
std::vector<Ray> WorkloadRays::scattered(const Wave& wave, std::uint32_t rays_a_hit, float tmax,
                                         std::uint64_t seed) const {
    constexpr std::uint32_t sequences = 1024;  // runs of directions, of which each hit draws one
    const std::vector<Vec3> normal = normals(scene_, wave.hits);
    std::vector<SurfacePoint> points;
    for (std::size_t i = 0; i < wave.rays.size(); ++i) {
        if (!wave.hits[i].hit()) continue;
        const std::uint32_t pixel = wave.pixels[i];
        points.push_back(
            {point_before(wave.rays[i], wave.hits[i].t, step_back_part * diagonal_),
             normal_toward(Double3(normal[i]), wave.rays[i].direction), pixel,
             static_cast<std::uint32_t>(hash_of(seed + scatter_salt, pixel) % sequences)});
    }
    std::vector<Ray> rays(points.size() * rays_a_hit);
    make_hemisphere_rays(
        points, {.samples = rays_a_hit, .sequences = sequences, .tmax = tmax, .seed = seed}, rays);
    return rays;
}

/// Rays of bounce 1, 2, ...: those of the paths that have met something each time before.
std::vector<Ray> WorkloadRays::bounced(const Wave& primary, int bounce) const {
    Wave wave = primary;
    for (int k = 1;; ++k) {
        std::vector<Ray> next =
            scattered(wave, 1, infinity, hash_of(options_.common.seed, std::uint64_t(k)));
        if (k == bounce) return next;
        std::vector<std::uint32_t> pixels;
        for (std::size_t i = 0; i < wave.rays.size(); ++i)
            if (wave.hits[i].hit()) pixels.push_back(wave.pixels[i]);
        wave = traced(std::move(next), std::move(pixels));
    }
}

/// From each hit to the lamp. t is 1 there. The lamp hangs over the camera whose number the seed
/// gives, a twentieth of the way to its target higher. The area lamp is a square about it that
/// faces the target, with sides of a tenth of that way.
std::vector<Ray> WorkloadRays::lamp_rays(const Wave& wave, bool area) const {
    constexpr float just_before = 1.0f - 0x1p-10f;
    const std::uint64_t seed = options_.common.seed;
    const Camera& camera = cameras_[seed % cameras_.size()];
    const CameraAxes axes(camera);
    const double reach = length(Double3(camera.target) - Double3(camera.position));
    const Double3 lamp = Double3(camera.position) + axes.up * (0.05 * reach);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < wave.rays.size(); ++i) {
        if (!wave.hits[i].hit()) continue;
        const auto offset = [&](std::uint64_t k) {
            return area ? 0.1 * reach * (chance(seed + lamp_salt, wave.pixels[i], k) - 0.5) : 0.0;
        };
        const Double3 goal = lamp + axes.right * offset(0) + axes.up * offset(1);
        const Vec3 origin = point_before(wave.rays[i], wave.hits[i].t, step_back_part * diagonal_);
        rays.push_back({origin, 0.0f, (goal - Double3(origin)).rounded(), just_before});
    }
    return rays;
}

/// A scanner with 64 beams from 10 degrees above the horizon to 30 below it, 2,048 times a turn,
/// all beams of a time in a row. Turn k starts at camera k, pulled into the box, and moves a tenth
/// of the way to what the camera looks at.
std::vector<Ray> WorkloadRays::lidar_turn(std::size_t turn) const {
    constexpr std::size_t beams = 64, times = 2048;
    constexpr double degree = std::numbers::pi / 180;
    const Camera& camera = cameras_[turn];
    const Double3 up = normalized(Double3(camera.up));
    const Double3 ahead = normalized(cross(up, CameraAxes(camera).right));
    const Double3 aside = cross(ahead, up);
    const Double3 from = into_box(Double3(camera.position), box_, 0.05);
    const Double3 to = at(from, into_box(Double3(camera.target), box_, 0.05), 0.1);
    const double start = chance(options_.common.seed + turn_salt, turn, 0);
    std::vector<Ray> rays(beams * times);
    for (std::size_t k = 0; k < times; ++k) {
        const double part = double(k) / double(times);
        const double angle = 2 * std::numbers::pi * (start + part);
        const Double3 horizontal = ahead * std::cos(angle) + aside * std::sin(angle);
        const Vec3 origin = at(from, to, part).rounded();
        for (std::size_t b = 0; b < beams; ++b) {
            const double height = degree * (10 - 40 * double(b) / double(beams - 1));
            rays[k * beams + b] = {
                origin, 0.0f, (horizontal * std::cos(height) + up * std::sin(height)).rounded()};
        }
    }
    return rays;
}

/// From anywhere in the box in any direction.
std::vector<Ray> WorkloadRays::random_rays(std::size_t count) const {
    const std::uint64_t seed = options_.common.seed + random_salt;
    std::vector<Ray> rays(count);
    for_each_index(count, [&](std::size_t i) {
        const auto within = [&](float lo, float hi, std::uint64_t k) {
            return static_cast<float>(lo + chance(seed, i, k) * (double(hi) - lo));
        };
        rays[i].origin = {within(box_.lo.x, box_.hi.x, 0), within(box_.lo.y, box_.hi.y, 1),
                          within(box_.lo.z, box_.hi.z, 2)};
        rays[i].direction = sphere_direction(chance(seed, i, 3), chance(seed, i, 4));
    });
    return rays;
}

/// From a sphere about the box whose radius is the box's diagonal, anywhere inward.
std::vector<Ray> WorkloadRays::outside_rays(std::size_t count) const {
    const std::uint64_t seed = options_.common.seed + outside_salt;
    const Double3 center = at(Double3(box_.lo), Double3(box_.hi), 0.5);
    std::vector<Ray> rays(count);
    for_each_index(count, [&](std::size_t i) {
        const Vec3 place = sphere_direction(chance(seed, i, 0), chance(seed, i, 1));
        const Vec3 direction = sphere_direction(chance(seed, i, 2), chance(seed, i, 3));
        rays[i].origin = (center + Double3(place) * diagonal_).rounded();
        rays[i].direction = dot(place, direction) > 0 ? -1.0f * direction : direction;
    });
    return rays;
}

}  // namespace raydix::bench
