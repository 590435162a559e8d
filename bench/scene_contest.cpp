#include "scene_contest.h"

#include <algorithm>
#include <stdexcept>

#include "bench_clock.h"
#include "cli/output.h"

namespace raydix::bench {
namespace {

/// What is asked for: all modes of both sides, and how each of them answers.
struct Contender {
    SideMode mode;
    RaySide* side;
};

/// Timed in turns: what each mode does, and what is done untimed before it.
struct Turn {
    std::function<void()> prepare, work;
};

void time_in_turns(std::vector<TimedMode>& modes, const std::vector<Turn>& turns,
                   const SceneBench& options) {
    const clockid_t clock = clock_from(options.clock);
    for (std::size_t round = 0; round < std::size_t(options.rounds); ++round)
        for (std::size_t k = 0; k < modes.size(); ++k) {
            if (turns[k].prepare) turns[k].prepare();
            const double start = seconds_of(clock);
            turns[k].work();
            modes[k].ms[round] += 1e3 * (seconds_of(clock) - start);
        }
}

TimedMode timed_mode(const SideMode& mode, const SceneBench& options) {
    return {mode.side,   mode.name,   mode.ours,
            mode.single, mode.robust, std::vector<double>(std::size_t(options.rounds)),
            {}};
}

/// One launch through all contenders; fills the differences of peers.
void compare(Question& question, const std::vector<Contender>& contenders,
             std::span<const Ray> rays, bool any, const SceneBench& options) {
    const auto ours = std::find_if(contenders.begin(), contenders.end(),
                                   [](const Contender& c) { return c.mode.ours; });
    const auto robust = std::find_if(contenders.begin(), contenders.end(),
                                     [](const Contender& c) { return c.mode.robust; });
    std::optional<Answers> expected, of_robust;
    if (ours != contenders.end()) {
        send(ours->mode, any);
        expected.emplace(*ours->side, any, rays.size());
        question.hits += expected->hit_count();
        if (robust != contenders.end()) {
            send(robust->mode, any);
            of_robust.emplace(*robust->side, any, rays.size());
        }
    }
    for (std::size_t k = 0; k < contenders.size(); ++k) {
        const Contender& c = contenders[k];
        send(c.mode, any);  // also warms up what has nothing to be compared with
        const Answers answers(*c.side, any, rays.size());
        if (!expected && k == 0) question.hits += answers.hit_count();
        if (!expected) continue;
        if (c.mode.ours) {
            if (answers != *expected)
                throw std::runtime_error(question.workload + ", " + question.scene +
                                         ": our single calls have other hits than our batches");
            continue;
        }
        auto& sum = question.modes[k].differences;
        if (!sum) sum.emplace();
        add(*sum,
            differences_of({rays, *expected, of_robust && !c.mode.robust ? &*of_robust : nullptr,
                            options.tolerance, *ours->side, ours->mode, c.mode.side},
                           answers));
    }
}

Question ask(const Question& about, const RayKindOf& rays, bool any,
             const std::vector<Contender>& all, const SceneBench& options) {
    Question question = about;
    question.text = rays.name + (any ? " any" : " closest");
    std::vector<Contender> contenders;
    for (const Contender& c : all)
        if (any ? c.mode.any : c.mode.closest) contenders.push_back(c);
    for (const Contender& c : contenders) question.modes.push_back(timed_mode(c.mode, options));
    std::vector<Turn> turns;
    for (const Contender& c : contenders) turns.push_back({{}, any ? c.mode.any : c.mode.closest});
    for (const std::vector<Ray>& launch : rays.launches) {
        for (const Contender& c : contenders) c.side->take(launch);
        compare(question, contenders, launch, any, options);
        time_in_turns(question.modes, turns, options);
        question.count += launch.size();
    }
    return question;
}

/// The best mode that `is` accepts, or nothing.
template <class Is>
std::optional<std::size_t> best_mode(const Question& question, const Is& is) {
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < question.modes.size(); ++k)
        if (is(question.modes[k]) && (!best || cli::spread_of(question.modes[k].ms).median <
                                                   cli::spread_of(question.modes[*best].ms).median))
            best = k;
    return best;
}

}  // namespace

std::vector<Ratio> ratios_of(const Question& question) {
    struct Rule {
        const char* figure;
        bool (*ours)(const TimedMode&);
        bool (*peer)(const TimedMode&);
    };
    const Rule rules[] = {{"batch", [](const TimedMode& m) { return m.ours && !m.single; },
                           [](const TimedMode& m) { return !m.ours && !m.robust; }},
                          {"single", [](const TimedMode& m) { return m.ours && m.single; },
                           [](const TimedMode& m) { return !m.ours && m.single && !m.robust; }},
                          {"single robust", [](const TimedMode& m) { return m.ours && m.single; },
                           [](const TimedMode& m) { return !m.ours && m.single && m.robust; }}};
    std::vector<Ratio> ratios;
    for (const Rule& rule : rules) {
        const auto ours = best_mode(question, rule.ours), peer = best_mode(question, rule.peer);
        if (!ours || !peer) continue;
        const TimedMode &a = question.modes[*ours], &b = question.modes[*peer];
        std::vector<double> pairs;
        const auto of = [&](double our_ms, double peer_ms) {
            return question.compares_times ? our_ms / peer_ms : peer_ms / our_ms;
        };
        for (std::size_t round = 0; round < a.ms.size(); ++round)
            pairs.push_back(of(a.ms[round], b.ms[round]));
        const cli::Spread spread = cli::spread_of(pairs);
        ratios.push_back({rule.figure, *ours, *peer,
                          of(cli::spread_of(a.ms).median, cli::spread_of(b.ms).median), spread.min,
                          spread.max});
    }
    return ratios;
}

std::vector<Question> ask_rays(const Question& about, const RayKindOf& rays, RaySide* ours,
                               const RaySides& peers, const SceneBench& options) {
    std::vector<Contender> contenders;
    for (const auto& peer : peers)
        for (const SideMode& mode : peer->modes()) contenders.push_back({mode, peer.get()});
    if (ours != nullptr)
        for (const SideMode& mode : ours->modes()) contenders.push_back({mode, ours});
    return {ask(about, rays, false, contenders, options),
            ask(about, rays, true, contenders, options)};
}

Question ask_all_hits(const Question& about, const RayKindOf& rays, AllHitsSide& ours,
                      const std::vector<std::unique_ptr<AllHitsSide>>& peers,
                      const SceneBench& options) {
    Question question = about;
    question.text = rays.name + " all hits";
    std::vector<Turn> turns;
    std::vector<AllHitsSide*> sides;
    const auto enter = [&](AllHitsSide& side) {
        for (const SideMode& mode : side.modes()) {
            question.modes.push_back(timed_mode(mode, options));
            turns.push_back({{}, mode.closest});
            sides.push_back(&side);
        }
    };
    for (const auto& peer : peers) enter(*peer);
    enter(ours);
    const SideMode batch = ours.modes().front();
    for (const std::vector<Ray>& launch : rays.launches) {
        for (AllHitsSide* side : sides) side->take(launch);
        batch.closest();
        std::vector<std::vector<float>> expected;
        for (std::size_t i = 0; i < launch.size(); ++i) {
            expected.push_back(ours.distances(i));
            question.hits += expected.back().size();
        }
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].work();
            if (question.modes[k].ours) continue;
            auto& sum = question.modes[k].differences;
            if (!sum) sum.emplace();
            add(*sum, differences_of_rows(launch, expected, *sides[k], question.modes[k].side,
                                          options.tolerance, ours));
        }
        time_in_turns(question.modes, turns, options);
        question.count += launch.size();
    }
    return question;
}

Question ask_closest(const Question& about, std::span<const Vec3> queries, const Mesh& mesh,
                     ClosestSide& ours, const std::vector<std::unique_ptr<ClosestSide>>& peers,
                     const SceneBench& options) {
    Question question = about;
    question.count = question.hits = queries.size();
    std::vector<Turn> turns;
    const auto enter = [&](ClosestSide& side) {
        side.take(queries);
        for (const SideMode& mode : side.modes()) {
            question.modes.push_back(timed_mode(mode, options));
            turns.push_back({[&side, queries] { side.take(queries); }, mode.closest});
        }
    };
    for (const auto& peer : peers) {
        enter(*peer);
        turns.back().work();
    }
    enter(ours);
    turns.back().work();
    std::vector<float> single;
    for (std::size_t i = 0; i < queries.size(); ++i) single.push_back(ours.distance(i));
    ours.modes().front().closest();
    for (std::size_t i = 0; i < queries.size(); ++i)
        if (ours.distance(i) != single[i])
            throw std::runtime_error("our single calls have other distances than our batches");
    for (std::size_t k = 0; k < peers.size(); ++k) {
        question.modes[k].differences = differences_of_distances(
            queries, mesh, ours, *peers[k], question.modes[k].side, options.tolerance);
    }
    time_in_turns(question.modes, turns, options);
    return question;
}

std::vector<Question> ask_moving(const Question& about,
                                 const std::array<std::vector<Affine>, 2>& places,
                                 const RayKindOf& rays, MovingSide& ours,
                                 const std::vector<std::unique_ptr<MovingSide>>& peers,
                                 const SceneBench& options) {
    std::vector<MovingSide*> sides;
    for (const auto& peer : peers) sides.push_back(peer.get());
    sides.push_back(&ours);
    std::vector<Question> questions;
    struct Way {
        const char* text;
        bool with_transforms;
        std::size_t count;
    };
    const std::size_t all = places[0].size(), few = (all + 99) / 100;
    for (const auto& [text, with_transforms, count] :
         {Way{"commit", false, all}, Way{"transforms and commit", true, all},
          Way{"transforms of 1 %, commit", true, few}}) {
        Question question = about;
        question.text = text;
        question.in_ms = question.compares_times = true;
        std::vector<Turn> turns;
        std::vector<std::size_t> moves(sides.size(), 0);
        for (std::size_t k = 0; k < sides.size(); ++k) {
            MovingSide* side = sides[k];
            question.modes.push_back(timed_mode(
                {.side = side->name(), .name = "commit", .ours = side == &ours}, options));
            const auto move = [&places, &moves, side, k, moved = count] {
                side->move(std::span(places[++moves[k] % 2]).first(moved));
            };
            if (with_transforms)
                turns.push_back({{}, [move, side] {
                                     move();
                                     side->commit();
                                 }});
            else
                turns.push_back({move, [side] { side->commit(); }});
            if (turns[k].prepare) turns[k].prepare();
            turns[k].work();
        }
        time_in_turns(question.modes, turns, options);
        for (std::size_t k = 0; k + 1 < sides.size(); ++k) {
            Differences& found = question.modes[k].differences.emplace();
            for (const std::vector<Ray>& launch : rays.launches) {
                RaySide &a = ours.rays(), &b = sides[k]->rays();
                const SideMode batch = a.modes().front(), theirs = b.modes().front();
                a.take(launch);
                b.take(launch);
                batch.closest();
                theirs.closest();
                const Answers expected(a, false, launch.size()), answers(b, false, launch.size());
                add(found, differences_of({launch, expected, nullptr, options.tolerance, a, batch,
                                           theirs.side},
                                          answers));
            }
        }
        questions.push_back(question);
    }
    return questions;
}

}  // namespace raydix::bench
