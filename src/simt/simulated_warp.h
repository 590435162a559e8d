// The warp policy of the simulator: up to 128 lanes on the host. A step runs for the active lanes
// and is charged once for all of them. Counters rise in charged steps only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "base/atomic.h"
#include "base/bits.h"
#include "simt/op.h"
#include "simt/thread_warp.h"

namespace raydix {

/// How often an operation was issued, and for how many lanes in sum.
struct OpCount {
    std::uint64_t issues = 0;
    std::uint64_t lanes = 0;

    friend bool operator==(const OpCount&, const OpCount&) = default;
};
using OpCounts = std::array<OpCount, op_count>;

inline void add_counts(OpCounts& sum, const OpCounts& more) {
    for (std::size_t k = 0; k < op_count; ++k) {
        sum[k].issues += more[k].issues;
        sum[k].lanes += more[k].lanes;
    }
}

/// Sees what the active lanes read or write in one go. Of memory models.
class MemoryObserver {
public:
    /// `addresses`, one a lane, null of those that take no part.
    virtual void access(const void* const* addresses, std::uint32_t lanes, std::uint32_t bytes,
                        Access how) = 0;
    /// `entries`: heights in the stacks of the lanes' own threads; below 0: takes no part.
    virtual void stack(const std::int32_t* entries, std::uint32_t lanes, Access how) = 0;

protected:
    ~MemoryObserver() = default;
};

/// `Isa` marks code that was compiled for certain processors, so that no two versions of it share a
/// name.
template <class Lane, int Width = 32, class Isa = void>
class SimulatedWarp {
    static_assert(Width >= 1 && Width <= 128);

public:
    /// A set of lanes: bit k is lane k.
    using Mask = std::conditional_t<(Width <= 64), std::uint64_t, Uint128>;

    std::array<Lane, Width> lanes{};
    WarpMemory<Lane> memory{};
    OpCounts* tally = nullptr;  // of this warp, or of several that run one after the other
    MemoryObserver* observer = nullptr;
    bool stacks_travel = false;  // with their rays: they lie apart, not side by side in lanes

    [[nodiscard]] static constexpr std::uint32_t width() { return Width; }
    [[nodiscard]] Mask active() const { return active_; }

    template <class Cond, class Body>
    void loop(Op op, Cond cond, Body body) {
        const Mask entered = active_;
        while ((active_ = votes(cond)) != 0) {
            charge(op);
            body();
        }
        active_ = entered;
    }
    template <class Cond, class Body>
    void when(Cond cond, Body body) {
        const Mask entered = active_;
        if ((active_ = votes(cond)) != 0) body();
        active_ = entered;
    }
    template <class Fn>
    void step(Op op, Fn fn) {
        charge(op);
        for (Mask left = active_; left != 0; left &= left - 1)
            fn(lanes[static_cast<std::size_t>(lowest_one(left))]);
    }
    template <class Fn, class First, class ThenFirst, class Second, class ThenSecond>
    void step_then(Op op, Fn fn, First first, ThenFirst then_first, Second second,
                   ThenSecond then_second) {
        charge(op);
        Mask firsts = 0, seconds = 0;
        for (Mask left = active_; left != 0; left &= left - 1) {
            const int k = lowest_one(left);
            Lane& lane = lanes[static_cast<std::size_t>(k)];
            fn(lane);
            firsts |= Mask{bool(first(lane))} << k;
            seconds |= Mask{bool(second(lane))} << k;
        }
        among(firsts, then_first);
        among(seconds, then_second);
    }
    template <class Fn>
    void step_indexed(Op op, Fn fn) {
        charge(op);
        for (Mask left = active_; left != 0; left &= left - 1) {
            const auto k = static_cast<std::uint32_t>(lowest_one(left));
            fn(lanes[k], k);
        }
    }
    template <class Address>
    void touches(Access how, Address address, std::uint32_t bytes) {
        if (observer == nullptr) return;
        std::array<const void*, Width> addresses{};
        for (Mask left = active_; left != 0; left &= left - 1) {
            const auto k = static_cast<std::size_t>(lowest_one(left));
            addresses[k] = address(lanes[k]);
        }
        observer->access(addresses.data(), width(), bytes, how);
    }
    template <class Entry>
    void touches_stack(Access how, Entry entry) {
        if (observer == nullptr) return;
        if (stacks_travel)
            return touches(
                how, [&](const Lane& l) { return l.stack + entry(l); }, sizeof(std::int32_t));
        std::array<std::int32_t, Width> entries;
        entries.fill(-1);
        for (Mask left = active_; left != 0; left &= left - 1) {
            const auto k = static_cast<std::size_t>(lowest_one(left));
            entries[k] = entry(lanes[k]);
        }
        observer->stack(entries.data(), width(), how);
    }
    template <class Cond, class Body, class Stay>
    void voting_loop(Op op, Cond cond, Body body, Stay stay) {
        const Mask entered = active_;
        while ((active_ = votes(cond)) != 0) {
            charge(op);
            body();
            if (!stay()) break;
        }
        active_ = entered;
    }
    template <class Cond>
    [[nodiscard]] Mask ballot(Op op, Cond cond) {
        charge(op);
        return votes(cond);
    }
    template <class Cond>
    [[nodiscard]] Mask ballot_indexed(Op op, Cond cond) {
        charge(op);
        Mask found = 0;
        for (Mask left = active_; left != 0; left &= left - 1) {
            const auto k = static_cast<std::uint32_t>(lowest_one(left));
            found |= Mask{bool(cond(lanes[k], k))} << k;
        }
        return found;
    }
    template <class Cond>
    [[nodiscard]] bool any(Op op, Cond cond) {
        charge(op);
        for (Mask left = active_; left != 0; left &= left - 1)
            if (cond(lanes[static_cast<std::size_t>(lowest_one(left))])) return true;
        return false;
    }
    [[nodiscard]] std::uint32_t take(Op op, std::uint32_t& counter, std::uint32_t count) {
        charge(op);
        charge(Op::shuffle);
        return claim(counter, count);
    }
    template <class Fn>
    auto uniform(Op op, Fn fn) {
        charge(op);
        return fn();
    }
    template <class Cond, class Body>
    void uniform_loop(Op op, Cond cond, Body body) {
        while (cond()) {
            charge(op);
            body();
        }
    }
    template <class Body>
    void among(Mask mask, Body body) {
        const Mask entered = active_;
        active_ &= mask;
        if (active_ != 0) body();
        active_ = entered;
    }
    template <class Fn>
    void write_shared(Op op, Fn fn) {
        charge(op);
        fn();
    }
    void meet() const {}
    /// Charges what the active lanes did elsewhere.
    void issue(Op op) { charge(op); }

private:
    template <class Cond>
    [[nodiscard]] Mask votes(Cond cond) const {
        Mask found = 0;
        for (Mask left = active_; left != 0; left &= left - 1) {
            const int k = lowest_one(left);
            found |= Mask{bool(cond(lanes[static_cast<std::size_t>(k)]))} << k;
        }
        return found;
    }
    /// Policies run bodies for at least one lane, so a charged step always has one.
    void charge(Op op) {
        OpCount& count = (*tally)[static_cast<std::size_t>(op)];
        ++count.issues;
        count.lanes += static_cast<std::uint64_t>(count_ones(active_));
    }

    Mask active_ = static_cast<Mask>(~Mask{0}) >> (8 * sizeof(Mask) - Width);
};

}  // namespace raydix
