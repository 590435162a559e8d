#include "cpu_rates.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "bench_clock.h"
#include "cli/output.h"
#include "exec/parallel.h"
#include "hit_distance.h"

namespace raydix::bench {
namespace {

/// What a portion gives: closest hits, or 0 and 1.
struct Answers {
    std::vector<Hit> hits;
    std::vector<std::uint8_t> found;

    void make_room(bool any, std::size_t rays) {
        hits.resize(any ? 0 : rays);
        found.resize(any ? rays : 0);
    }
};

/// A mode on the bench.
struct Contender {
    Mode mode;
    ModeFigures figures;
    std::vector<double> ms;  // of each round, summed over the portions
};

/// All calls of a portion, one after the other.
void send(const Mode& mode, bool any, const Portion& portion, Answers& answers) {
    const std::span<const Ray> rays = portion.rays;
    std::size_t begin = 0;
    for (const std::size_t end : portion.ends) {
        const std::size_t count = end - begin;
        if (any)
            mode.any(rays.subspan(begin, count), std::span(answers.found).subspan(begin, count));
        else
            mode.closest(rays.subspan(begin, count), std::span(answers.hits).subspan(begin, count));
        begin = end;
    }
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

std::uint64_t hits_in(const Answers& answers) {
    return std::uint64_t(std::ranges::count_if(answers.hits, [](const Hit& h) { return h.hit(); }) +
                         std::ranges::count(answers.found, 1));
}

/// The untimed round: all modes must answer, ours in the same bits.
void compare(WorkloadFigures& workload, std::vector<Contender>& all, bool any,
             const Portion& portion, double tolerance) {
    const auto ours =
        std::ranges::find_if(all, [](const Contender& c) { return c.figures.automatic; });
    Answers expected, answers;
    expected.make_room(any, portion.rays.size());
    answers.make_room(any, portion.rays.size());
    send(ours->mode, any, portion, expected);
    workload.hits += hits_in(expected);
    for (Contender& c : all) {
        with_threads(c.figures.threads, [&] { send(c.mode, any, portion, answers); });
        if (c.figures.peer.ours()) {
            if (!same_bits(expected, answers))
                throw std::runtime_error(workload.name + ": " + c.figures.peer.text + ", " +
                                         c.mode.name + ": other hits than " +
                                         ours->figures.peer.text + ", " + ours->mode.name);
            continue;
        }
        const Differences here = differences_of(portion.rays, expected, answers, tolerance);
        c.figures.differences.hit_or_miss += here.hit_or_miss;
        c.figures.differences.distance += here.distance;
    }
}

void time_portion(std::vector<Contender>& all, bool any, const Portion& portion,
                  const CpuBench& options) {
    const clockid_t clock = clock_from(options.clock);
    const int warm_ups = portion.rays.size() < rays_of_a_long_pass ? warm_ups_of_a_short_pass : 0;
    Answers answers;
    answers.make_room(any, portion.rays.size());
    for (int round = 0; round < options.rounds; ++round)
        for (Contender& c : all)
            with_threads(c.figures.threads, [&] {
                for (int k = 0; k < warm_ups; ++k) send(c.mode, any, portion, answers);
                const double start = seconds_of(clock);
                send(c.mode, any, portion, answers);
                c.ms[std::size_t(round)] += 1e3 * (seconds_of(clock) - start);
            });
}

}  // namespace

WorkloadFigures measure_rates(const Workload& workload, const WorkloadRays& rays,
                              const std::vector<PeerName>& names,
                              const std::vector<std::unique_ptr<Peer>>& peers,
                              const CpuBench& options, const std::vector<int>& thread_counts) {
    const bool any = workload.any();
    std::vector<Contender> all;
    for (std::size_t p = 0; p < peers.size(); ++p)
        for (const Mode& mode : peers[p]->modes())
            for (const int threads : thread_counts)
                all.push_back({mode,
                               {names[p], mode.name, mode.single, mode.automatic, threads, {}, {}},
                               std::vector<double>(std::size_t(options.rounds))});
    WorkloadFigures figures;
    figures.name = workload.text;
    cli::Progress progress(workload.text, options.common);
    rays.for_each(workload, [&](const Portion& portion, double done) {
        compare(figures, all, any, portion, options.tolerance);
        time_portion(all, any, portion, options);
        figures.rays += portion.rays.size();
        figures.calls += portion.ends.size();
        progress.show(done);
    });
    for (const Contender& c : all) {
        figures.modes.push_back(c.figures);
        if (figures.rays == 0) continue;
        std::vector<double> rates;
        for (const double ms : c.ms) rates.push_back(double(figures.rays) / ms * 1e-3);
        figures.modes.back().mrays_per_s = cli::spread_of(rates);
    }
    return figures;
}

}  // namespace raydix::bench
