#include "scene_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "base/double3.h"
#include "base/math.h"
#include "bench_clock.h"
#include "cli/output.h"
#include "rays/hemisphere_rays.h"

namespace raydix::bench {
namespace {

/// Until memory that is used again comes round, and the ways of rays are known.
constexpr std::uint64_t frames_before = 6;
constexpr int trials = 3;

enum Part : std::size_t { commit_part, primary_part, ao_part, part_count };

/// One side, and what its frames took.
class ContenderInMotion {
public:
    ContenderInMotion(FrameSide& side, bool ours, const SceneBench& options)
        : side_(side), ours_(ours), clock_(clock_from(options.clock)) {}

    [[nodiscard]] FrameSide& side() const { return side_; }
    [[nodiscard]] bool is_ours() const { return ours_; }
    [[nodiscard]] const SideMode& primary() const { return primary_; }
    [[nodiscard]] const SideMode& ao() const { return ao_; }

    void choose_modes(std::span<const Ray> primary, std::span<const Ray> ao) {
        std::vector<SideMode> modes = side_.rays().modes();
        if (ours_) std::erase_if(modes, [](const SideMode& mode) { return mode.single; });
        const auto fastest = [&](std::span<const Ray> rays, bool any) {
            side_.rays().take(rays);
            std::vector<double> least(modes.size(), infinity);
            for (int trial = 0; trial < trials; ++trial)
                for (std::size_t k = 0; k < modes.size(); ++k)
                    least[k] = std::min(least[k], time([&] { send(modes[k], any); }));
            return modes[std::size_t(std::ranges::min_element(least) - least.begin())];
        };
        primary_ = fastest(primary, false);
        ao_ = fastest(ao, true);
    }

    /// The picture, where its vertices are known; keeps the times if `counts`.
    void run(std::span<const Ray> primary, std::span<const Ray> ao, bool counts) {
        std::array<double, part_count> ms;
        ms[commit_part] = time([&] { side_.commit(); });
        side_.rays().take(primary);
        ms[primary_part] = time(primary_.closest);
        side_.rays().take(ao);
        ms[ao_part] = time(ao_.any);
        if (!counts) return;
        double sum = 0;
        for (std::size_t part = 0; part < part_count; ++part) {
            ms_[part].push_back(ms[part]);
            sum += ms[part];
        }
        frame_ms_.push_back(sum);
    }

    [[nodiscard]] TimedMode frame() const {
        return {side_.name(), "primary " + primary_.name + ", ao " + ao_.name,
                ours_,        false,
                false,        frame_ms_,
                differences};
    }
    [[nodiscard]] TimedMode part(Part part) const {
        const std::string names[] = {"commit", primary_.name, ao_.name};
        return {side_.name(), names[part], ours_, false, false, ms_[part], differences};
    }
    [[nodiscard]] double median_ms() const { return cli::spread_of(frame_ms_).median; }

    std::optional<Differences> differences;  // of peers

private:
    template <class Work>
    double time(const Work& work) const {
        const double start = seconds_of(clock_);
        work();
        return 1e3 * (seconds_of(clock_) - start);
    }

    FrameSide& side_;
    bool ours_;
    clockid_t clock_;
    SideMode primary_, ao_;
    std::array<std::vector<double>, part_count> ms_;
    std::vector<double> frame_ms_;
};

/// Adds what peers answer otherwise than we do, of whom the first one is. All have the same frame.
void compare(std::vector<ContenderInMotion>& all, std::span<const Ray> rays, bool any,
             const SceneBench& options, std::uint64_t& hits) {
    const auto answers_of = [&](const ContenderInMotion& c) {
        c.side().rays().take(rays);
        send(any ? c.ao() : c.primary(), any);
        return Answers(c.side().rays(), any, rays.size());
    };
    const ContenderInMotion& ours = all.front();
    const Answers expected = answers_of(ours);
    hits += expected.hit_count();
    for (ContenderInMotion& peer : all) {
        if (peer.is_ours()) continue;
        const Answers answers = answers_of(peer);
        if (!peer.differences) peer.differences.emplace();
        add(*peer.differences,
            differences_of({rays, expected, nullptr, options.tolerance, ours.side().rays(),
                            any ? ours.ao() : ours.primary(), peer.side().name()},
                           answers));
    }
}

}  // namespace

MovingPicture::MovingPicture(const Mesh& mesh, cli::Size size, std::uint64_t seed)
    : mesh_(mesh),
      box_(bounds_of(mesh)),
      seed_(seed),
      primary_(make_rays(box_, size, seed).front().launches.front()) {}

std::vector<Vec3> MovingPicture::vertices(std::uint64_t frame) const {
    const double height = std::max(double(box_.hi.y) - box_.lo.y, 1e-6);
    const double phase = 2 * std::numbers::pi * (double(frame) / 24 + double(seed_ % 1000) / 1000);
    const Vec3 middle = center_of(box_);
    std::vector<Vec3> moved;
    moved.reserve(mesh_.vertices.size() + 1);  // Embree reads 16 bytes a vertex
    for (const Vec3 v : mesh_.vertices) {
        const double part = (double(v.y) - box_.lo.y) / height;
        const double angle = 0.5 * std::sin(phase) * (part - 0.5),
                     sway = 0.05 * height * std::sin(phase + 3 * part);
        const double x = double(v.x) - middle.x, z = double(v.z) - middle.z;
        moved.push_back({float(middle.x + std::cos(angle) * x - std::sin(angle) * z + sway), v.y,
                         float(middle.z + std::sin(angle) * x + std::cos(angle) * z)});
    }
    return moved;
}

std::vector<Ray> MovingPicture::ao(std::span<const Vec3> vertices, const RaySide& hits) const {
    const double diagonal = diagonal_of(box_);
    std::vector<SurfacePoint> points;
    for (std::size_t i = 0; i < primary_.size(); ++i) {
        const PlacedHit hit = hits.hit(i);
        if (!hit.hit()) continue;
        const Triangle& t = mesh_.triangles[hit.prim];
        const auto pixel = static_cast<std::uint32_t>(i);
        points.push_back({point_before(primary_[i], hit.t, step_back_part * diagonal),
                          normal_toward(normal_of(vertices[t[0]], vertices[t[1]], vertices[t[2]]),
                                        primary_[i].direction),
                          pixel, pixel % 1024});
    }
    std::vector<Ray> rays(points.size());
    make_hemisphere_rays(points,
                         {.samples = 1,
                          .sequences = 1024,
                          .tmax = static_cast<float>(ao_radius_part * diagonal),
                          .seed = seed_},
                         rays);
    return rays;
}

std::vector<Question> ask_frames(const Question& about, const MovingPicture& picture,
                                 FrameSide& ours,
                                 const std::vector<std::unique_ptr<FrameSide>>& peers,
                                 FrameSide& guide, const SceneBench& options) {
    std::vector<ContenderInMotion> all;
    all.emplace_back(ours, true, options);
    for (const auto& peer : peers) all.emplace_back(*peer, false, options);
    Question frame = about;
    frame.text = "frame";
    frame.in_ms = true;
    const std::uint64_t frames = frames_before + std::uint64_t(options.rounds);
    const SideMode guide_mode = guide.rays().modes().front();
    for (std::uint64_t f = 0; f < frames; ++f) {
        const std::vector<Vec3> vertices = picture.vertices(f);
        guide.move(vertices);
        guide.commit();
        guide.rays().take(picture.primary());
        guide_mode.closest();
        const std::vector<Ray> ao = picture.ao(vertices, guide.rays());
        for (ContenderInMotion& c : all) {
            c.side().move(vertices);
            if (f != 0) continue;
            c.side().commit();
            c.choose_modes(picture.primary(), ao);
        }
        const bool counts = f >= frames_before;
        for (std::size_t k = 0; k < all.size(); ++k)
            all[(f + k) % all.size()].run(picture.primary(), ao, counts);
        if (f + 1 != frames_before && f + 1 != frames) continue;
        frame.count += picture.primary().size() + ao.size();
        compare(all, picture.primary(), false, options, frame.hits);
        compare(all, ao, true, options, frame.hits);
    }
    const ContenderInMotion& best =
        *std::ranges::min_element(all.begin() + 1, all.end(), {}, &ContenderInMotion::median_ms);
    for (const ContenderInMotion& c : all) frame.modes.push_back(c.frame());
    std::vector<Question> questions{frame};
    const char* texts[] = {"commit", "primary", "ao"};
    for (const Part part : {commit_part, primary_part, ao_part}) {
        Question question = frame;
        question.workload = "frame parts";
        question.text = texts[part];
        question.modes = {best.part(part), all.front().part(part)};
        questions.push_back(question);
    }
    return questions;
}

}  // namespace raydix::bench
