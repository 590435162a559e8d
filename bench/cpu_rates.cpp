#include "cpu_rates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "cli/output.h"
#include "hit_distance.h"
#include "measure/stopwatch.h"

namespace raydix::bench {
namespace {

/// What a launch gives: closest hits, or 0 and 1.
struct Answers {
    std::vector<Hit> hits;
    std::vector<std::uint8_t> found;

    void make_room(bool any, std::size_t rays) {
        hits.resize(any ? 0 : rays);
        found.resize(any ? rays : 0);
    }
};

void send(const Mode& mode, bool any, std::span<const Ray> rays, Answers& answers, int threads) {
    if (any)
        mode.any(rays, answers.found, threads);
    else
        mode.closest(rays, answers.hits, threads);
}

Differences differences_of(std::span<const Ray> rays, const Answers& ours, const Answers& theirs,
                           double tolerance) {
    Differences found;
    for (std::size_t i = 0; i < ours.found.size(); ++i)
        found.hit_or_miss += ours.found[i] != theirs.found[i];
    for (std::size_t i = 0; i < ours.hits.size(); ++i) {
        const Hit &a = ours.hits[i], &b = theirs.hits[i];
        if (a.hit() != b.hit())
            ++found.hit_or_miss;
        else if (a.hit())
            found.distance += far_apart(rays[i], a.t, b.t, tolerance);
    }
    return found;
}

bool same_bits(const Answers& a, const Answers& b) {
    const std::size_t bytes = a.hits.size() * sizeof(Hit);
    return a.found == b.found &&
           (bytes == 0 || std::memcmp(a.hits.data(), b.hits.data(), bytes) == 0);
}

/// The untimed round: all modes must answer, ours in the same bits.
void compare(KindRates& all, std::span<const Ray> rays, const std::vector<PeerName>& names,
             const CpuBench& options) {
    const bool any = all.kind == RayKind::ao;
    const auto ours = std::find_if(all.modes.begin(), all.modes.end(), [&](const ModeRates& m) {
        return names[m.peer].ours() && m.mode.automatic;
    });
    Answers expected, answers;
    expected.make_room(any, rays.size());
    answers.make_room(any, rays.size());
    send(ours->mode, any, rays, expected, ours->threads);
    for (ModeRates& m : all.modes) {
        send(m.mode, any, rays, answers, m.threads);
        if (names[m.peer].ours()) {
            if (!same_bits(expected, answers))
                throw std::runtime_error(names[m.peer].text + ", " + m.mode.name +
                                         ": other hits than " + names[ours->peer].text + ", " +
                                         ours->mode.name);
            continue;
        }
        const Differences here = differences_of(rays, expected, answers, options.tolerance);
        m.differences.hit_or_miss += here.hit_or_miss;
        m.differences.distance += here.distance;
    }
}

void time_launch(KindRates& all, std::span<const Ray> rays, int rounds) {
    const bool any = all.kind == RayKind::ao;
    Answers answers;
    answers.make_room(any, rays.size());
    for (int round = 0; round < rounds; ++round)
        for (ModeRates& m : all.modes) {
            Stopwatch watch;
            send(m.mode, any, rays, answers, m.threads);
            m.ms[static_cast<std::size_t>(round)] += watch.lap();
        }
}

}  // namespace

KindRates measure_rates(RayKind kind, const cli::RayLaunches& launches,
                        const std::vector<PeerName>& names,
                        const std::vector<std::unique_ptr<Peer>>& peers, const CpuBench& options,
                        const std::vector<int>& thread_counts) {
    KindRates all;
    all.kind = kind;
    for (std::size_t p = 0; p < peers.size(); ++p)
        for (const Mode& mode : peers[p]->modes())
            for (const int threads : thread_counts)
                all.modes.push_back(
                    {p, mode, threads, std::vector<double>(std::size_t(options.rounds)), {}});
    cli::Progress progress(fmt::format("{} rays", ray_kind_name(kind)), options.common);
    launches.for_each(kind, [&](const cli::RayUnit& unit, double done) {
        compare(all, unit.rays, names, options);
        time_launch(all, unit.rays, options.rounds);
        all.rays += unit.rays.size();
        ++all.launches;
        progress.show(done);
    });
    return all;
}

}  // namespace raydix::bench
