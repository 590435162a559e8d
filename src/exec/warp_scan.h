// Prefix sums by warps, for backends without a library that has them: tiles of 1,024 values are
// summed up, their sums scanned in the same way, and each tile scanned from where the tiles before
// it end. values [n] -> values [n], each the sum of those before it. Launches are
// launch_tiles(label, n, work): work(warp, t) for t in [0, n), 32 lanes that work together.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "exec/arena.h"
#include "exec/warp.h"

namespace raydix {

/// Values of a tile: a warp takes them in so many rounds of 32.
inline constexpr std::uint32_t tile_rounds = 32, tile_items = tile_rounds * warp_lanes;
[[nodiscard]] RAYDIX_HD constexpr std::uint32_t tiles_for(std::uint32_t items) {
    return items / tile_items + (items % tile_items != 0 ? 1 : 0);
}

/// How many items there are: `limit`, or *count if that is less. The device reads it.
struct ItemCount {
    std::uint32_t limit;
    const std::uint32_t* count;  // may be null
    [[nodiscard]] RAYDIX_HD std::uint32_t get() const {
        return count == nullptr || *count > limit ? limit : *count;
    }
};

/// Each lane's value becomes the sum of those of the lanes up to it.
template <class Warp, class T>
RAYDIX_HD void sum_up_lanes(const Warp& warp, typename Warp::template Var<T>& value) {
    for (std::uint32_t step = 1; step < warp_lanes; step *= 2) {
        const auto before =
            warp.shuffle(value, [&](std::uint32_t lane) { return lane >= step ? lane - step : 0; });
        warp.each([&](std::uint32_t lane) {
            if (lane >= step) value[lane] = value[lane] + before[lane];
        });
    }
}

template <class T>
struct SumTiles {
    const T* values;
    ItemCount items;
    T* sums;  // [tiles], out

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        typename Warp::template Var<T> sum;
        const std::uint32_t n = items.get();
        warp.each([&](std::uint32_t lane) {
            T all = 0;
            for (std::uint32_t r = 0; r < tile_rounds; ++r) {
                const std::uint64_t i = std::uint64_t{t} * tile_items + r * warp_lanes + lane;
                if (i < n) all += values[i];
            }
            sum[lane] = all;
        });
        sum_up_lanes<Warp, T>(warp, sum);
        const T total = warp.broadcast(sum, warp_lanes - 1);
        warp.each([&](std::uint32_t lane) {
            if (lane == 0) sums[t] = total;
        });
    }
};

template <class T>
struct ScanTiles {
    T* values;
    ItemCount items;
    const T* starts;    // [tiles]: the sum of the tiles before each; null if there is one tile
    T* total;           // [1], out: where the last tile leaves the sum of all; may be null
    bool total_behind;  // it leaves the sum behind the last value instead
    std::uint32_t last_tile;

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        typename Warp::template Var<T> own, sum;
        const std::uint32_t n = items.get();
        T start = starts == nullptr ? T{0} : starts[t];
        for (std::uint32_t r = 0; r < tile_rounds; ++r) {
            const std::uint64_t first = std::uint64_t{t} * tile_items + r * warp_lanes;
            warp.each([&](std::uint32_t lane) {
                own[lane] = first + lane < n ? values[first + lane] : T{0};
                sum[lane] = own[lane];
            });
            sum_up_lanes<Warp, T>(warp, sum);
            warp.each([&](std::uint32_t lane) {
                if (first + lane < n) values[first + lane] = start + (sum[lane] - own[lane]);
            });
            start += warp.broadcast(sum, warp_lanes - 1);
        }
        if (t != last_tile) return;
        warp.each([&](std::uint32_t lane) {
            if (lane != 0) return;
            if (total_behind)
                values[n] = start;
            else if (total != nullptr)
                *total = start;
        });
    }
};

/// The sums of tiles, then of tiles of these, up to one tile.
template <class T>
struct ScanScratch {
    static constexpr int most_levels = 4;  // 1024^4 values
    T* sums[most_levels] = {};

    ScanScratch(Arena& arena, std::uint32_t limit) {
        int level = 0;
        for (std::uint32_t n = tiles_for(limit); n > 1; n = tiles_for(n))
            sums[level++] = arena.take<T>(n);
    }
};

template <class T>
struct ScanJob {
    T* values;
    ItemCount items;
    T* total = nullptr;
    bool total_behind = false;  // to values[items], which must be there
};

template <class Launcher, class T>
void launch_scan(Launcher& launcher, const char* label, const ScanJob<T>& job,
                 const ScanScratch<T>& scratch) {
    struct Level {
        T* values;
        ItemCount items;
    };
    Level levels[ScanScratch<T>::most_levels + 1];
    int top = 0;
    levels[0] = {job.values, job.items};
    while (tiles_for(levels[top].items.limit) > 1) {
        const Level& below = levels[top];
        const std::uint32_t tiles = tiles_for(below.items.limit);
        T* sums = scratch.sums[top];
        launcher.launch_tiles(label, tiles, SumTiles<T>{below.values, below.items, sums});
        levels[++top] = {sums, {tiles, nullptr}};
    }
    for (int k = top; k >= 0; --k) {
        const std::uint32_t tiles = tiles_for(levels[k].items.limit);
        const bool lowest = k == 0;
        launcher.launch_tiles(
            label, tiles == 0 ? 1 : tiles,
            ScanTiles<T>{levels[k].values, levels[k].items,
                         k == top ? nullptr : levels[k + 1].values, lowest ? job.total : nullptr,
                         lowest && job.total_behind, tiles == 0 ? 0 : tiles - 1});
    }
}

}  // namespace raydix
