// Work that 32 lanes do together: what a lane keeps is a Var, and lanes speak to each other through
// ballots and shuffles. HostWarp runs the lanes in a loop, CudaWarp is a warp of a GPU; one text
// serves both. All lanes take part in every call: control flow around calls depends on uniform
// values only.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "base/hd.h"

namespace raydix {

inline constexpr std::uint32_t warp_lanes = 32;

/// The place of the `rank`-th set bit of `mask`, counted from 0; 31 if there is none.
RAYDIX_HD inline std::uint32_t nth_set_bit(std::uint32_t mask, std::uint32_t rank) {
    std::uint32_t place = 0;
    for (std::uint32_t width = 16; width != 0; width /= 2) {
        const std::uint32_t low = mask & ((1u << width) - 1);
#if defined(__CUDA_ARCH__)
        const auto ones = static_cast<std::uint32_t>(__popc(low));
#else
        const auto ones = static_cast<std::uint32_t>(std::popcount(low));
#endif
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

#if defined(__CUDACC__)
struct CudaWarp {
    static constexpr unsigned all = 0xFFFFFFFFu;

    template <class T>
    class Var {
    public:
        __device__ T& operator[](std::uint32_t) { return value_; }
        __device__ const T& operator[](std::uint32_t) const { return value_; }

    private:
        T value_{};
    };

    __device__ static std::uint32_t lane() { return threadIdx.x % warp_lanes; }

    template <class Body>
    __device__ void each(const Body& body) const {
        body(lane());
        __syncwarp();
    }
    template <class Vote>
    [[nodiscard]] __device__ std::uint32_t ballot(const Vote& vote) const {
        return __ballot_sync(all, vote(lane()));
    }
    template <class T, class Source>
    [[nodiscard]] __device__ Var<T> shuffle(const Var<T>& from, const Source& source) const {
        Var<T> to;
        to[0] = __shfl_sync(all, from[0], static_cast<int>(source(lane()) & 31));
        return to;
    }
    template <class T>
    [[nodiscard]] __device__ T broadcast(const Var<T>& from, std::uint32_t source) const {
        return __shfl_sync(all, from[0], static_cast<int>(source));
    }
    __device__ void sync() const {
        __threadfence();
        __syncwarp();
    }
};
#endif

}  // namespace raydix
