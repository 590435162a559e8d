// A stable radix sort by warps, for backends without a library that has one: digits of five bits,
// the lowest first, because a warp has a lane for each of their 32 values. A pass counts the digits
// of tiles of 1,024 pairs, scans the counts and moves the pairs. Lanes find those of their own
// digit by five ballots, so that a tile's pairs keep their order. keys and values [n] -> sorted.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "exec/host_launcher.h"  // SortArrays
#include "exec/warp_scan.h"

namespace raydix {

inline constexpr std::uint32_t digit_bits = 5, digit_values = 32;

/// What a pass sorts by.
template <class Key>
struct Digit {
    std::uint32_t shift, bits;  // bits 0 to 5
    [[nodiscard]] RAYDIX_HD std::uint32_t of(Key key) const {
        return bits == 0 ? 0u : static_cast<std::uint32_t>(key >> shift) & ((1u << bits) - 1);
    }
};

/// The lanes that vote as `digit` says, of those that `there` names.
template <class Votes>
RAYDIX_HD std::uint32_t lanes_with(const Votes& votes, std::uint32_t there, std::uint32_t digit) {
    std::uint32_t lanes = there;
    for (std::uint32_t bit = 0; bit < digit_bits; ++bit)
        lanes &= (digit >> bit & 1) != 0 ? votes.of[bit] : ~votes.of[bit];
    return lanes;
}

/// 32 pairs of a tile: each lane's digit, and who has which.
template <class Key, class Warp>
struct DigitRound {
    struct Votes {
        std::uint32_t of[digit_bits];
    };
    typename Warp::template Var<std::uint32_t> digit;
    Votes votes;
    std::uint32_t there;

    RAYDIX_HD DigitRound(const Warp& warp, const Key* keys, const Digit<Key>& rule,
                         std::uint64_t first, std::uint32_t n) {
        warp.each([&](std::uint32_t lane) {
            digit[lane] = first + lane < n ? rule.of(keys[first + lane]) : 0u;
        });
        there = warp.ballot([&](std::uint32_t lane) { return first + lane < n; });
        for (std::uint32_t bit = 0; bit < digit_bits; ++bit)
            votes.of[bit] =
                warp.ballot([&](std::uint32_t lane) { return (digit[lane] >> bit & 1) != 0; });
    }
};

template <class Key>
struct CountDigits {
    const Key* keys;
    ItemCount items;
    Digit<Key> digit;
    std::uint32_t* counts;  // [digit_values][tiles], out
    std::uint32_t tiles;

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        typename Warp::template Var<std::uint32_t> count;  // lane d counts digit d
        warp.each([&](std::uint32_t lane) { count[lane] = 0; });
        const std::uint32_t n = items.get();
        for (std::uint32_t r = 0; r < tile_rounds; ++r) {
            const std::uint64_t first = std::uint64_t{t} * tile_items + r * warp_lanes;
            const DigitRound<Key, Warp> round(warp, keys, digit, first, n);
            warp.each([&](std::uint32_t lane) {
                count[lane] =
                    count[lane] + words::count_ones(lanes_with(round.votes, round.there, lane));
            });
        }
        warp.each([&](std::uint32_t lane) { counts[lane * tiles + t] = count[lane]; });
    }
};

template <class Key>
struct MovePairs {
    SortArrays<Key> pairs;  // from keys and values to the sorted ones
    ItemCount items;
    Digit<Key> digit;
    const std::uint32_t* starts;  // [digit_values][tiles]: where each tile's pairs begin
    std::uint32_t tiles;

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        typename Warp::template Var<std::uint32_t> next;  // lane d: the next place of digit d
        warp.each([&](std::uint32_t lane) { next[lane] = starts[lane * tiles + t]; });
        const std::uint32_t n = items.get();
        for (std::uint32_t r = 0; r < tile_rounds; ++r) {
            const std::uint64_t first = std::uint64_t{t} * tile_items + r * warp_lanes;
            const DigitRound<Key, Warp> round(warp, pairs.keys, digit, first, n);
            const auto start =
                warp.shuffle(next, [&](std::uint32_t lane) { return round.digit[lane]; });
            warp.each([&](std::uint32_t lane) {
                if (first + lane < n) {
                    const std::uint32_t mine =
                        lanes_with(round.votes, round.there, round.digit[lane]);
                    const std::uint32_t before = mine & ((1u << lane) - 1);
                    const std::uint32_t at = start[lane] + words::count_ones(before);
                    pairs.sorted_keys[at] = pairs.keys[first + lane];
                    pairs.sorted_values[at] = pairs.values[first + lane];
                }
                next[lane] =
                    next[lane] + words::count_ones(lanes_with(round.votes, round.there, lane));
            });
        }
    }
};

struct SortScratch {
    std::uint32_t* counts;  // [digit_values][tiles]
    ScanScratch<std::uint32_t> scan;

    SortScratch(Arena& arena, std::uint32_t limit)
        : counts(arena.take<std::uint32_t>(digit_values * tiles_for(limit))),
          scan(arena, digit_values * tiles_for(limit)) {}
};

/// Sorts the first `items` pairs by the lowest `key_bits` bits. The unsorted ones are lost.
template <class Launcher, class Key>
void launch_sort(Launcher& launcher, const char* label, SortArrays<Key> arrays,
                 const ItemCount& items, int key_bits, const SortScratch& scratch) {
    const std::uint32_t tiles = tiles_for(items.limit);
    if (tiles == 0) return;
    const auto bits = static_cast<std::uint32_t>(key_bits);
    // An odd number of passes, so that the last one ends in the sorted arrays.
    std::uint32_t passes = (bits + digit_bits - 1) / digit_bits;
    if (passes % 2 == 0) ++passes;
    for (std::uint32_t pass = 0; pass < passes; ++pass) {
        const std::uint32_t shift = bits * pass / passes;
        const Digit<Key> digit{shift, bits * (pass + 1) / passes - shift};
        launcher.launch_tiles(label, tiles,
                              CountDigits<Key>{arrays.keys, items, digit, scratch.counts, tiles});
        launch_scan(launcher, label,
                    ScanJob<std::uint32_t>{scratch.counts, {digit_values * tiles, nullptr}},
                    scratch.scan);
        launcher.launch_tiles(label, tiles,
                              MovePairs<Key>{arrays, items, digit, scratch.counts, tiles});
        arrays = {arrays.sorted_keys, arrays.sorted_values, arrays.keys, arrays.values};
    }
}

}  // namespace raydix
