// The sort of radix_sort.h. Memory: one record per key; a second one only for buckets too large for
// one core.
#include "sort/radix_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::size_t insertion_limit = 24;  // shorter runs: insertion sort beats counting
constexpr int max_digit_bits = 11;  // 2048 counters, 8 KB: half of a first-level cache is left
constexpr std::size_t alone_limit = 1u << 18;  // larger buckets are split again by all threads
constexpr std::size_t max_blocks = 64;
constexpr std::size_t min_block = 1u << 11;

template <class Key>
using Record = SortRecord<Key>;

template <class Key>
void insertion_sort(Record<Key>* a, std::size_t n) {
    for (std::size_t i = 1; i < n; ++i) {
        const Record<Key> moving = a[i];
        std::size_t k = i;
        for (; k > 0 && a[k - 1].key > moving.key; --k) a[k] = a[k - 1];
        a[k] = moving;
    }
}

/// One more than the highest bit in which any two keys differ; 0 if all are equal.
template <class Key>
int differing_bits(const Record<Key>* a, std::size_t n) {
    Key differs = 0;
    for (std::size_t i = 1; i < n; ++i) differs |= a[i].key ^ a[0].key;
    return static_cast<int>(std::bit_width(differs));
}

struct DigitPair {
    int low_shift, high_shift, bits;
    [[nodiscard]] std::size_t size() const { return std::size_t{1} << bits; }
};

/// The two digits that sort almost all of `n` keys which differ below bit `differing`.
DigitPair choose_digits(std::size_t n, int differing) {
    const int wanted = std::min(differing, static_cast<int>(std::bit_width(n)) + 8);
    const int bits = std::min((wanted + 1) / 2, max_digit_bits);
    const int high_shift = std::max(differing - bits, 0);
    return {std::max(high_shift - bits, 0), high_shift, bits};
}

template <class Key>
void count_digits(const Record<Key>* a, std::size_t n, DigitPair digits, std::uint32_t* low,
                  std::uint32_t* high) {
    const Key mask = static_cast<Key>(digits.size() - 1);
    std::fill_n(low, digits.size(), 0u);
    std::fill_n(high, digits.size(), 0u);
    for (std::size_t i = 0; i < n; ++i) {
        ++low[a[i].key >> digits.low_shift & mask];
        ++high[a[i].key >> digits.high_shift & mask];
    }
}

void starts_from_counts(std::uint32_t* counts, std::size_t n) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const std::uint32_t count = counts[i];
        counts[i] = sum;
        sum += count;
    }
}

template <class Key>
void scatter(const Record<Key>* from, Record<Key>* to, std::size_t n, int shift, Key mask,
             std::uint32_t* starts) {
    for (std::size_t i = 0; i < n; ++i) to[starts[from[i].key >> shift & mask]++] = from[i];
}

/// Sorts `a` on one thread, with `spare` [n] beside it.
template <class Key>
void sort_alone(Record<Key>* a, Record<Key>* spare, std::size_t n) {
    if (n <= insertion_limit) return insertion_sort(a, n);
    const int differing = differing_bits(a, n);
    if (differing == 0) return;
    const DigitPair digits = choose_digits(n, differing);
    const Key mask = static_cast<Key>(digits.size() - 1);
    std::array<std::uint32_t, 1u << max_digit_bits> low, high;
    count_digits(a, n, digits, low.data(), high.data());
    starts_from_counts(low.data(), digits.size());
    starts_from_counts(high.data(), digits.size());
    scatter(a, spare, n, digits.low_shift, mask, low.data());
    scatter(spare, a, n, digits.high_shift, mask, high.data());
    if (digits.low_shift == 0) return;
    // Keys that agree in both digits stand together, in their old order: finish each such run.
    for (std::size_t begin = 0; begin < n;) {
        const Key prefix = a[begin].key >> digits.low_shift;
        std::size_t end = begin + 1;
        while (end < n && a[end].key >> digits.low_shift == prefix) ++end;
        if (end - begin > 1) sort_alone(a + begin, spare + begin, end - begin);
        begin = end;
    }
}

/// Where the buckets of one distribution start: [buckets + 1].
using BucketStarts = std::vector<std::size_t>;

/// Stable distribution of n keys by `digit_bits` bits at `shift`, over all threads. `visit(begin,
/// end, f)` calls f(record) for records [begin, end).
template <class Key, class Visit>
BucketStarts distribute(std::size_t n, int shift, int digit_bits, const Visit& visit,
                        Record<Key>* to, Buffer<std::uint32_t>& histogram) {
    const std::size_t buckets = std::size_t{1} << digit_bits;
    const std::size_t block = std::max(min_block, (n + max_blocks - 1) / max_blocks);
    const std::size_t blocks = (n + block - 1) / block;
    const auto digit = [shift, mask = static_cast<Key>(buckets - 1)](Key key) {
        return key >> shift & mask;
    };
    histogram.reset(blocks * buckets);
    for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        std::uint32_t* counts = histogram.data() + b * buckets;
        std::fill_n(counts, buckets, 0u);
        visit(begin, end, [&](const Record<Key>& record) { ++counts[digit(record.key)]; });
    });
    BucketStarts starts(buckets + 1);
    std::uint32_t sum = 0;
    for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
        starts[bucket] = sum;
        for (std::size_t b = 0; b < blocks; ++b) {
            const std::uint32_t count = histogram[b * buckets + bucket];
            histogram[b * buckets + bucket] = sum;
            sum += count;
        }
    }
    starts[buckets] = n;
    for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        std::uint32_t* next = histogram.data() + b * buckets;
        visit(begin, end,
              [&](const Record<Key>& record) { to[next[digit(record.key)]++] = record; });
    });
    return starts;
}

/// More buckets for more keys, so that one bucket and its spare fit a second-level cache.
int digit_bits_for(std::size_t n) {
    return std::clamp(static_cast<int>(std::bit_width(n)) - 12, 6, max_digit_bits);
}

/// Sorts a bucket that is too large for one thread: splits it at its own highest differing bits,
/// then its buckets.
template <class Key>
void sort_together(Record<Key>* a, std::size_t n, SortScratch<Key>& scratch) {
    const int differing = differing_bits(a, n);
    if (differing == 0) return;
    const int bits = std::min(digit_bits_for(n), differing);
    if (scratch.spare.size() < n) scratch.spare.reset(n);
    Record<Key>* spare = scratch.spare.data();
    const auto visit = [a](std::size_t begin, std::size_t end, const auto& f) {
        for (std::size_t i = begin; i < end; ++i) f(a[i]);
    };
    const BucketStarts starts =
        distribute<Key>(n, differing - bits, bits, visit, spare, scratch.histogram);
    for_each_index(
        n, [&](std::size_t i) { a[i] = spare[i]; }, 1u << 16);
    for (std::size_t b = 0; b + 1 < starts.size(); ++b)
        if (starts[b + 1] - starts[b] > alone_limit)
            sort_together(a + starts[b], starts[b + 1] - starts[b], scratch);
    for_each_range(starts.size() - 1, 1, [&](std::size_t first, std::size_t last) {
        for (std::size_t b = first; b < last; ++b) {
            const std::size_t size = starts[b + 1] - starts[b];
            if (size <= alone_limit) sort_alone(a + starts[b], spare + starts[b], size);
        }
    });
}

}  // namespace

template <class Key>
std::vector<std::size_t> sort_on_the_way(std::size_t n, int key_bits, const LoadKeys<Key>& load,
                                         const TakeSorted<Key>& take, SortScratch<Key>& scratch) {
    if (scratch.records.size() < n) scratch.records.reset(n);
    Record<Key>* records = scratch.records.data();
    const int bits = std::min(digit_bits_for(n), key_bits);
    const auto visit = [&](std::size_t begin, std::size_t end, const auto& f) {
        std::array<Key, 256> batch;
        for (std::size_t i = begin; i < end; i += batch.size()) {
            const std::size_t count = std::min(batch.size(), end - i);
            load(i, i + count, batch.data());
            for (std::size_t k = 0; k < count; ++k)
                f(Record<Key>{batch[k], static_cast<std::uint32_t>(i + k)});
        }
    };
    const BucketStarts starts =
        distribute<Key>(n, key_bits - bits, bits, visit, records, scratch.histogram);
    for (std::size_t b = 0; b + 1 < starts.size(); ++b)
        if (starts[b + 1] - starts[b] > alone_limit)
            sort_together(records + starts[b], starts[b + 1] - starts[b], scratch);
    for_each_range(starts.size() - 1, 1, [&](std::size_t first, std::size_t last) {
        Buffer<Record<Key>> spare;
        for (std::size_t b = first; b < last; ++b) {
            const std::size_t size = starts[b + 1] - starts[b];
            if (size <= alone_limit) {
                if (spare.size() < size) spare.reset(2 * size);
                sort_alone(records + starts[b], spare.data(), size);
            }
            if (size != 0) take(starts[b], {records + starts[b], size});
        }
    });
    return starts;
}

template <class Key>
void sort_keys(std::span<Key> keys, std::span<std::uint32_t> order, int key_bits,
               SortScratch<Key>& scratch) {
    const auto load = [&](std::size_t begin, std::size_t end, Key* out) {
        std::copy(keys.begin() + begin, keys.begin() + end, out);
    };
    const auto take = [&](std::size_t begin, std::span<const Record<Key>> sorted) {
        for (std::size_t k = 0; k < sorted.size(); ++k) {
            keys[begin + k] = sorted[k].key;
            order[begin + k] = sorted[k].position;
        }
    };
    sort_on_the_way<Key>(keys.size(), key_bits, load, take, scratch);
}

template std::vector<std::size_t> sort_on_the_way(std::size_t, int, const LoadKeys<std::uint32_t>&,
                                                  const TakeSorted<std::uint32_t>&,
                                                  SortScratch<std::uint32_t>&);
template std::vector<std::size_t> sort_on_the_way(std::size_t, int, const LoadKeys<std::uint64_t>&,
                                                  const TakeSorted<std::uint64_t>&,
                                                  SortScratch<std::uint64_t>&);
template void sort_keys(std::span<std::uint32_t>, std::span<std::uint32_t>, int,
                        SortScratch<std::uint32_t>&);
template void sort_keys(std::span<std::uint64_t>, std::span<std::uint32_t>, int,
                        SortScratch<std::uint64_t>&);

}  // namespace raydix
