// Work that 32 lanes do together: what a lane keeps is a Var, and lanes speak to each other through
// ballots and shuffles. HostWarp runs the lanes in a loop, DeviceWarp is a warp of a GPU; one text
// serves both. All lanes take part in every call: control flow around calls depends on uniform
// values only.
#pragma once

#include <array>
#include <cstdint>

#include "base/bits.h"
#include "base/device_words.h"
#include "base/hd.h"

namespace raydix {

inline constexpr std::uint32_t warp_lanes = 32;
/// Warps that have a lane for each of so many items.
[[nodiscard]] RAYDIX_HD constexpr std::uint32_t warps_for(std::uint32_t items) {
    return items / warp_lanes + (items % warp_lanes != 0 ? 1 : 0);
}

/// The place of the highest set bit of `mask`, which has one.
RAYDIX_HD inline std::uint32_t highest_set_bit(std::uint32_t mask) {
    return 31 - static_cast<std::uint32_t>(leading_zeros(mask));
}

/// The place of the `rank`-th set bit of `mask`, counted from 0; 31 if there is none.
RAYDIX_HD inline std::uint32_t nth_set_bit(std::uint32_t mask, std::uint32_t rank) {
    std::uint32_t place = 0;
    for (std::uint32_t width = 16; width != 0; width /= 2) {
        const std::uint32_t low = mask & ((1u << width) - 1);
        const std::uint32_t ones = words::count_ones(low);
        if (rank >= ones) {
            rank -= ones;
            mask >>= width;
            place += width;
        } else {
            mask = low;
        }
    }
    return place;
}

struct HostWarp {
    /// One value per lane.
    template <class T>
    class Var {
    public:
        T& operator[](std::uint32_t lane) { return values_[lane]; }
        const T& operator[](std::uint32_t lane) const { return values_[lane]; }

    private:
        std::array<T, warp_lanes> values_{};
    };

    /// body(lane) for every lane.
    template <class Body>
    void each(const Body& body) const {
        for (std::uint32_t lane = 0; lane < warp_lanes; ++lane) body(lane);
    }
    /// Bit k: vote(k).
    template <class Vote>
    [[nodiscard]] std::uint32_t ballot(const Vote& vote) const {
        std::uint32_t votes = 0;
        for (std::uint32_t lane = 0; lane < warp_lanes; ++lane)
            votes |= static_cast<std::uint32_t>(bool(vote(lane))) << lane;
        return votes;
    }
    /// Lane k gets the value of lane source(k).
    template <class T, class Source>
    [[nodiscard]] Var<T> shuffle(const Var<T>& from, const Source& source) const {
        Var<T> to;
        for (std::uint32_t lane = 0; lane < warp_lanes; ++lane) to[lane] = from[source(lane) & 31];
        return to;
    }
    template <class T>
    [[nodiscard]] T broadcast(const Var<T>& from, std::uint32_t lane) const {
        return from[lane];
    }
    /// What lanes wrote to memory is seen by all of them, and by whom a later arrive tells.
    void sync() const {}
};

#if defined(RAYDIX_DEVICE_COMPILER)
/// A warp of the device, on the words of base/device_words.h.
struct DeviceWarp {
    template <class T>
    class Var {
    public:
        RAYDIX_HD T& operator[](std::uint32_t) { return value_; }
        RAYDIX_HD const T& operator[](std::uint32_t) const { return value_; }

    private:
        T value_{};
    };

    template <class Body>
    RAYDIX_HD void each(const Body& body) const {
        body(words::lane_id());
        words::meet(all_lanes);
    }
    template <class Vote>
    [[nodiscard]] RAYDIX_HD std::uint32_t ballot(const Vote& vote) const {
        return words::ballot(all_lanes, vote(words::lane_id()));
    }
    template <class T, class Source>
    [[nodiscard]] RAYDIX_HD Var<T> shuffle(const Var<T>& from, const Source& source) const {
        Var<T> to;
        to[0] = broadcast(from, source(words::lane_id()) & 31);
        return to;
    }
    template <class T>
    [[nodiscard]] RAYDIX_HD T broadcast(const Var<T>& from, std::uint32_t source) const {
        return words::shuffle(all_lanes, from[0], source);
    }
    RAYDIX_HD void sync() const {
        words::fence();
        words::meet(all_lanes);
    }

private:
    static constexpr std::uint32_t all_lanes = 0xFFFFFFFFu;
};
#endif

}  // namespace raydix
