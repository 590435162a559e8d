// Which way rays take through a tree: the one that took the least time a ray. It cannot be told
// from the rays alone: it depends on how many of them go the same way in the tree and how deep, so
// on the scene too. What batches of a kind took is kept with the tree for those to come.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>

namespace raydix {

/// How rays can go through a tree.
enum class PathWay : std::uint8_t { packets, streams, turns, alone };
/// In which order: as the caller has them, or by where they start.
enum class RayOrder : std::uint8_t { given, sorted };

/// Ways that are slow with a small part of a job's rays, however fast they are with all of them.
constexpr bool needs_many(PathWay way) { return way == PathWay::streams; }
constexpr bool needs_many(RayOrder order) { return order == RayOrder::sorted; }

/// Of a batch from about one place in about one direction, as a picture is.
struct BatchView {
    // Where its middle ray starts, in longest sides of the scene, and where to, the longest 1.
    std::array<float, 3> place{}, way{};

    /// Whether a camera has jumped from there, or turned.
    [[nodiscard]] bool is_far_from(const BatchView& other) const {
        constexpr float step = 1.0f / 16, turn = 0.25f;
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (std::fabs(place[axis] - other.place[axis]) > step ||
                std::fabs(way[axis] - other.way[axis]) > turn)
                return true;
        return false;
    }
};

/// What ways took for batches that are alike, each in times of the others. Any number of threads
/// may add to it and ask it at once. Way: an enum of `way_count` values. Clock: as in std::chrono.
template <class Way, std::size_t way_count, class Clock = std::chrono::steady_clock>
class WayRates {
public:
    /// Rays begin to end - 1 of a job, by trace(way, begin, end). `ways`: those that there are, not
    /// more than four, in the order of promise. Most jobs go the fastest way known. In a trial some
    /// rays go another way, and both are timed side by side: what rays take differs from place to
    /// place. These are at least 256 rays, enough to tell, or an eighth; half of the job if it is
    /// large and needs_many(way), or once it has been tried twice and takes less than twice the
    /// time. A job of fewer than 512 tries one way at most, every fourth one if a way is due, with
    /// a quarter of its rays, or half if that way is not much slower. A job of fewer than 128 rays
    /// goes the other way as a whole, and the next one is timed beside it. In a job of 4,096 rays
    /// or more the rays of one way lie around those of the other.
    template <class Trace>
    void run(std::span<const Way> ways, std::size_t begin, std::size_t end, const Trace& trace) {
        const std::uint32_t job = jobs_.fetch_add(1, std::memory_order_relaxed);
        const Way best = fastest(ways);
        const std::size_t rays = end - begin;
        if (ways.size() < 2 || rays == 0) {
            if (rays != 0) trace(best, begin, end);
        } else if (rays < least_to_divide) {
            run_whole(ways, best, job, begin, end, trace);
        } else {
            run_divided(ways, best, job, begin, end, trace);
        }
    }

    /// The same of a job whose ways suit many rays alone. In a trial each has half of them, who
    /// needs many those in the middle.
    template <class Trace>
    void run_halves(std::span<const Way> ways, std::size_t begin, std::size_t end,
                    const Trace& trace) {
        const std::uint32_t job = jobs_.fetch_add(1, std::memory_order_relaxed);
        const Way best = fastest(ways);
        const auto tried = job > 0 ? longest_due(ways, best, job) : std::nullopt;
        if (!tried) {
            trace(best, begin, end);
            return;
        }
        try_around(std::span(&*tried, 1), best, (end - begin) / 2, needs_many(best), begin, end,
                   trace);
        pause(*tried, best, job);
    }

    /// The first one where nothing is known yet.
    [[nodiscard]] Way fastest(std::span<const Way> ways) const {
        Way best = ways.front();
        float least = known(best) ? cost(best) : 1.0f;
        for (const Way way : ways.subspan(1))
            if (known(way) && cost(way) < least) least = cost(way), best = way;
        return best;
    }

    /// A ray took so many times as long by `way` as one beside it by `other`, which is the first to
    /// be known or known already. It is lost if another thread adds something at the same time.
    void add(Way way, Way other, float ratio) {
        if (!(ratio > 0.0f && ratio < std::numeric_limits<float>::infinity()) ||
            adding_.test_and_set(std::memory_order_acquire))
            return;
        if (!known(other)) set(other, 1.0f);
        const float now = cost(other) * std::clamp(ratio, 1 / most_at_once, most_at_once);
        const bool led = known(way) && cost(way) < cost(other);
        const std::uint8_t trials = trials_of(way);
        // Of many the geometric mean: single ones are often far off, either way. The first one
        // finds memory as it was, and counts little once there is another.
        if (trials == 0) {
            set(way, now);
        } else {
            const float weight = trials == 1 ? 0.67f : std::max(1.0f / trials, 0.15f);
            const float change = std::clamp(now / cost(way), 1 / most_change, most_change);
            set(way, cost(way) * std::pow(change, weight));
        }
        if (trials < most_trials) set_trials(way, trials + 1);
        if (const float won = cost(way) / cost(other); won < 1.0f) {
            // It may have lost by chance: then it is not to rest for long.
            set_trials(other, std::min(trials_of(other), often_tried));
            if (!led) due_[index(other)].store(jobs_ + least_pause, std::memory_order_relaxed);
            // Nor are the rest to seem the slower for it, down to the one that has lost: two that
            // win from each other by chance would leave them behind without end.
            for (std::size_t k = 0; k < way_count && !led; ++k)
                if (k != index(way) && k != index(other)) {
                    const Way third = static_cast<Way>(k);
                    set(third, std::max(cost(third) * won, std::min(cost(third), cost(other))));
                }
        }
        keep_in_range();
        adding_.clear(std::memory_order_release);
    }

    /// A picture comes. If it is of another view, what is known of all ways counts as little as one
    /// trial, and they are soon tried again: not within `again_` jobs, twice as many each time that
    /// the way that is best stayed the same. Nothing if another thread adds something meanwhile.
    void see(const BatchView& view) {
        constexpr std::uint32_t wait = 4, least_again = 32, most_again = 1024;
        if (adding_.test_and_set(std::memory_order_acquire)) return;
        const std::uint32_t job = jobs_.load(std::memory_order_relaxed);
        if (!view_) {
            view_ = view;
        } else if (view.is_far_from(*view_) && job - seen_ >= again_) {
            const std::size_t best = best_known();
            again_ = best == best_seen_ ? std::min(2 * again_, most_again) : least_again;
            best_seen_ = best, seen_ = job, view_ = view;
            for (std::size_t way = 0; way < way_count; ++way) {
                if (trials_[way].load(std::memory_order_relaxed) < 2) continue;
                trials_[way].store(1, std::memory_order_relaxed);
                due_[way].store(job + wait, std::memory_order_relaxed);
            }
        }
        adding_.clear(std::memory_order_release);
    }

    /// Whether job number `job` should try `way`.
    [[nodiscard]] bool is_due(Way way, std::uint32_t job) const {
        return static_cast<std::int32_t>(waited(way, job)) >= 0;
    }

private:
    static constexpr std::size_t share_of_job = 8;
    static constexpr float most_at_once = 16.0f, near_cost = 1.2f, most_change = 4.0f;
    static constexpr float least_cost = 0x1p-10f;
    static constexpr std::uint32_t least_pause = 8, longest_pause = 1024;
    static constexpr std::uint8_t often_tried = 4, most_trials = 8;  // that are told apart
    /// Of jobs that go another way as a whole: rays of one that is asked once should not suffer.
    static constexpr std::uint32_t whole_pause = 4;
    static constexpr std::size_t least_to_divide = 128;
    static constexpr std::size_t least_share = 256, least_of_many = 2048;

    static std::size_t index(Way way) { return static_cast<std::size_t>(way); }
    [[nodiscard]] float cost(Way way) const {
        return costs_[index(way)].load(std::memory_order_relaxed);
    }
    [[nodiscard]] bool known(Way way) const { return cost(way) > 0.0f; }
    void set(Way way, float cost) { costs_[index(way)].store(cost, std::memory_order_relaxed); }

    [[nodiscard]] std::uint8_t trials_of(Way way) const {
        return trials_[index(way)].load(std::memory_order_relaxed);
    }
    void set_trials(Way way, int trials) {
        trials_[index(way)].store(static_cast<std::uint8_t>(trials), std::memory_order_relaxed);
    }
    /// Of all ways; way_count if none is known.
    [[nodiscard]] std::size_t best_known() const {
        std::size_t best = way_count;
        float least = std::numeric_limits<float>::infinity();
        for (std::size_t way = 0; way < way_count; ++way)
            if (const float one = costs_[way].load(std::memory_order_relaxed);
                one > 0.0f && one < least)
                least = one, best = way;
        return best;
    }
    [[nodiscard]] bool is_proven(Way way) const { return trials_of(way) >= 2; }
    /// Jobs since it has been due. Numbers of jobs may wrap around.
    [[nodiscard]] std::uint32_t waited(Way way, std::uint32_t job) const {
        return job - due_[index(way)].load(std::memory_order_relaxed);
    }

    /// Who wins by chance is thought too fast, and the others are compared with that. So where ways
    /// are alike all costs sink.
    void keep_in_range() {
        float least = 1.0f;
        for (const auto& cost : costs_)
            if (const float one = cost.load(std::memory_order_relaxed); one > 0.0f)
                least = std::min(least, one);
        if (least > least_cost) return;
        for (auto& cost : costs_)
            cost.store(cost.load(std::memory_order_relaxed) / least_cost,
                       std::memory_order_relaxed);
    }

    template <class Trace>
    static float time_a_ray(Way way, std::size_t begin, std::size_t end, const Trace& trace) {
        const auto start = Clock::now();
        trace(way, begin, end);
        const std::chrono::duration<float> took = Clock::now() - start;
        return took.count() / static_cast<float>(end - begin);
    }

    /// The slower a way is, the longer until it is tried again. Once it has been tried often, and
    /// is not close to the best, longer each time.
    void pause(Way way, Way best, std::uint32_t job, std::uint32_t least = 1) {
        std::uint32_t jobs = least;
        if (is_proven(way)) {
            const std::uint8_t trials = trials_of(way);
            const float ratio = std::max(cost(way) / cost(best), 1.0f);
            const bool often = trials > often_tried && ratio >= near_cost;
            const std::uint32_t longer = often ? 1u << std::min(trials - often_tried, 4) : 1;
            // Few trials may all be wrong.
            const std::uint32_t longest = std::min(least_pause << trials, longest_pause);
            jobs = static_cast<std::uint32_t>(
                std::min(static_cast<float>(least_pause * longer) * ratio * ratio,
                         static_cast<float>(longest)));
            // Not always the same job of batches that have a few.
            jobs += job * 0x9E3779B9u >> 30;
        }
        due_[index(way)].store(job + jobs, std::memory_order_relaxed);
    }

    /// Whether that is so of the number of trials of a way.
    bool next_is_odd(Way way) {
        return rounds_[index(way)].fetch_add(1, std::memory_order_relaxed) % 2 != 0;
    }

    /// Which of those that are due has waited longest, so that each has its turn.
    [[nodiscard]] std::optional<Way> longest_due(std::span<const Way> ways, Way best,
                                                 std::uint32_t job) const {
        std::optional<Way> found;
        for (const Way way : ways)
            if (way != best && is_due(way, job) &&
                (!found || waited(way, job) > waited(*found, job)))
                found = way;
        return found;
    }

    template <class Trace>
    void run_divided(std::span<const Way> ways, Way best, std::uint32_t job, std::size_t begin,
                     std::size_t end, const Trace& trace) {
        const std::size_t rays = end - begin;
        const bool small = rays < 2 * least_share;
        // The first job finds memory as it was.
        const bool may_try = small ? job % whole_pause == whole_pause - 1 : job > 0;
        std::array<Way, way_count> tried;
        std::size_t count = 0;
        if (may_try && !small)
            for (const Way way : ways)
                if (way != best && !is_proven(way) && is_due(way, job) && !needs_many(way))
                    tried[count++] = way;
        if (may_try && count == 0)
            if (const auto way = longest_due(ways, best, job)) tried[count++] = *way;
        if (count == 0) {
            trace(best, begin, end);
            return;
        }
        // The fewer rays packets and streams get, the more each of them takes: a way that is not
        // much slower by a small share gets half of the job.
        const float half_below = is_proven(tried[0]) && !small ? 2.0f : near_cost;
        const bool half =
            count == 1 && ((needs_many(tried[0]) && rays >= least_of_many) ||
                           (known(tried[0]) && cost(tried[0]) < half_below * cost(best)));
        const bool odd = next_is_odd(tried[0]);
        const bool large = rays >= 2 * least_of_many;
        const std::size_t share =
            half    ? rays / 2
            : small ? rays / 4
                    : std::min(std::max(least_share, rays / share_of_job), rays / (count + 1));
        const auto those = std::span(tried).first(count);
        if (large) {
            // Who needs many rays has half of a job that is not so large in one piece.
            const bool best_inside = half && needs_many(best);
            const bool changes =
                !half || rays >= 4 * least_of_many || !(best_inside || needs_many(tried[0]));
            try_around(those, best, share, (changes && odd) != best_inside, begin, end, trace);
        } else {
            // Who comes second finds in caches what the first one read.
            const std::size_t rest = rays - count * share, from = odd ? begin + rest : begin;
            std::array<float, way_count> took;
            float main = 0.0f;
            if (odd) main = time_a_ray(best, begin, from, trace);
            for (std::size_t k = 0; k < count; ++k)
                took[k] = time_a_ray(those[k], from + k * share, from + (k + 1) * share, trace);
            if (!odd) main = time_a_ray(best, end - rest, end, trace);
            for (std::size_t k = 0; k < count; ++k) add(those[k], best, took[k] / main);
        }
        for (const Way way : those) pause(way, best, job, small ? whole_pause : 1);
    }

    /// `share` rays go each of the ways that are tried: those in the middle, or else at both ends.
    /// What rays take often rises and falls along a job, as in a picture from the sky to the
    /// ground.
    template <class Trace>
    void try_around(std::span<const Way> tried, Way best, std::size_t share, bool at_ends,
                    std::size_t begin, std::size_t end, const Trace& trace) {
        const auto next = [&](Way way, std::size_t rays) {
            const std::size_t from = begin;
            begin += rays;
            return time_a_ray(way, from, begin, trace);
        };
        const std::size_t rest = end - begin - tried.size() * share;
        std::array<float, way_count> took;
        float main = 0.0f;
        if (at_ends) {
            for (std::size_t k = 0; k < tried.size(); ++k) took[k] = next(tried[k], share / 2);
            main = next(best, rest);
            for (std::size_t k = tried.size(); k-- > 0;)
                took[k] = (took[k] + next(tried[k], k > 0 ? share / 2 : end - begin)) / 2;
        } else {
            main = next(best, rest / 2);
            for (std::size_t k = 0; k < tried.size(); ++k) took[k] = next(tried[k], share);
            main = (main + next(best, end - begin)) / 2;
        }
        for (std::size_t k = 0; k < tried.size(); ++k) add(tried[k], best, took[k] / main);
    }

    /// A way whose time has yet to be compared: its number plus one, and the time as a float.
    static std::uint64_t pack(Way way, float took) {
        return (std::uint64_t{index(way)} + 1) << 32 | std::bit_cast<std::uint32_t>(took);
    }

    template <class Trace>
    void run_whole(std::span<const Way> ways, Way best, std::uint32_t job, std::size_t begin,
                   std::size_t end, const Trace& trace) {
        if (const std::uint64_t open = open_.exchange(0, std::memory_order_relaxed); open != 0) {
            const auto tried = static_cast<Way>((open >> 32) - 1);
            const float main = time_a_ray(best, begin, end, trace);
            if (tried == best) return;  // it has won since
            add(tried, best, std::bit_cast<float>(static_cast<std::uint32_t>(open)) / main);
            pause(tried, best, job, whole_pause);
            return;
        }
        if (job % whole_pause == whole_pause - 1)
            if (const auto way = longest_due(ways, best, job)) {
                open_.store(pack(*way, time_a_ray(*way, begin, end, trace)),
                            std::memory_order_relaxed);
                return;
            }
        trace(best, begin, end);
    }

    std::atomic<std::uint32_t> jobs_{0};
    std::array<std::atomic<std::uint8_t>, way_count> rounds_{};
    std::array<std::atomic<float>, way_count> costs_{};  // 0: not known
    std::array<std::atomic<std::uint32_t>, way_count> due_{};
    std::array<std::atomic<std::uint8_t>, way_count> trials_{};
    std::atomic<std::uint64_t> open_{0};
    // What `adding_` guards: the last view that counted, in which job, and the best way then.
    std::optional<BatchView> view_;
    std::uint32_t seen_ = 0, again_ = 0;
    std::size_t best_seen_ = way_count;
    std::atomic_flag adding_;
};

/// What a batch is like, as far as a few of its rays tell.
struct BatchKind {
    bool any = false, sorted = false;
    std::uint32_t apart = 0;   // where rays start that follow each other: 0 close to anywhere
    std::uint32_t spread = 0;  // of their directions: 0 to 2
    std::uint32_t size = 0;    // of the batch: 0 to 4
    std::optional<BatchView> view{};  // of pictures; it has no part in the index

    static constexpr std::uint32_t anywhere = 4;
    static constexpr std::size_t count = 2 * 2 * (anywhere + 1) * 3 * 5;
    [[nodiscard]] std::size_t index() const {
        return (((std::size_t{any} * 2 + sorted) * (anywhere + 1) + apart) * 3 + spread) * 5 + size;
    }
    static std::uint32_t size_of(std::size_t rays) {
        std::uint32_t size = 0;
        for (std::size_t limit = 128; size < 4 && rays >= limit; limit *= 8) ++size;
        return size;
    }
};

using PathWayRates = WayRates<PathWay, 4>;
using OrderRates = WayRates<RayOrder, 2>;

/// The rates of a tree, from the first batch on. A copy knows nothing yet.
class PathRates {
public:
    PathRates() = default;
    PathRates(const PathRates&) {}
    PathRates& operator=(const PathRates&) {
        known_ = std::make_shared<Known>();
        return *this;
    }
    ~PathRates() = default;

    /// From now on both know what either learns: a tree that follows another one is much like it.
    void share(const PathRates& other) { known_ = other.known_; }

    /// For a batch that comes.
    [[nodiscard]] PathWayRates& ways(const BatchKind& kind) {
        PathWayRates& rates = known_->table().ways[kind.index()];
        if (kind.view) rates.see(*kind.view);
        return rates;
    }
    [[nodiscard]] OrderRates& orders(const BatchKind& kind) {
        return known_->table().orders[kind.index()];
    }

private:
    struct Table {
        std::array<PathWayRates, BatchKind::count> ways;
        std::array<OrderRates, BatchKind::count> orders;
    };
    class Known {
    public:
        Known() = default;
        Known(const Known&) = delete;
        Known& operator=(const Known&) = delete;
        ~Known() { delete table_.load(); }

        [[nodiscard]] Table& table() {
            Table* table = table_.load(std::memory_order_acquire);
            if (table == nullptr) {
                auto made = std::make_unique<Table>();
                if (table_.compare_exchange_strong(table, made.get(), std::memory_order_acq_rel))
                    table = made.release();
            }
            return *table;
        }

    private:
        std::atomic<Table*> table_{nullptr};
    };

    std::shared_ptr<Known> known_ = std::make_shared<Known>();
};

/// The ways that the jobs of a batch may go, in the order of promise.
struct JobWays {
    std::array<PathWay, 4> ways{};
    std::size_t count = 0;
    PathWayRates* rates = nullptr;  // null: all jobs go the first way

    void add(PathWay way) { ways[count++] = way; }
    /// Rays begin to end - 1 of a job, by trace(way, begin, end).
    template <class Trace>
    void run(std::size_t begin, std::size_t end, const Trace& trace) const {
        if (rates == nullptr)
            trace(ways[0], begin, end);
        else
            rates->run(std::span(ways).first(count), begin, end, trace);
    }
};

}  // namespace raydix
