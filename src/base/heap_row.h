// Rows of results that one thread keeps in the caller's memory: the k nearest so far as a heap, and
// a sort that needs no memory of its own. For host and device; no containers.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "base/hd.h"

namespace raydix {

/// The k nearest of those offered, any k: a heap with the last of them on top, in two arrays [k].
template <class T>
class HeapRow {
public:
    RAYDIX_HD HeapRow(std::uint32_t k, std::uint32_t* indices, T* distances)
        : ids_(indices), d2_(distances), k_(k) {}
    [[nodiscard]] RAYDIX_HD T worst_d2() const {
        return size_ < k_ ? std::numeric_limits<T>::infinity() : d2_[0];
    }
    [[nodiscard]] RAYDIX_HD std::uint32_t worst_id() const {
        return size_ < k_ ? ~std::uint32_t{0} : ids_[0];
    }
    RAYDIX_HD void offer(T d2, std::uint32_t id) {
        if (size_ < k_) {
            std::uint32_t hole = size_++;
            for (; hole > 0 && is_after(d2, id, (hole - 1) / 2); hole = (hole - 1) / 2)
                move((hole - 1) / 2, hole);
            put(hole, d2, id);
        } else if (is_after(d2_[0], ids_[0], d2, id)) {
            sift_down(d2, id, size_);
        }
    }
    RAYDIX_HD void settle() const {}
    /// Heap sort: ascending by (d2, id), distances instead of their squares unless `squared`;
    /// missing ones, infinity and ~0, at the end. Returns how many there are.
    template <bool squared = false>
    RAYDIX_HD std::uint32_t finish(std::uint32_t*, T*) {
        for (std::uint32_t end = size_; end > 1;) {
            const T d2 = d2_[--end];
            const std::uint32_t id = ids_[end];
            move(0, end);
            sift_down(d2, id, end);
        }
        for (std::uint32_t i = 0; i < k_; ++i)
            i < size_ ? put(i, squared ? d2_[i] : std::sqrt(d2_[i]), ids_[i])
                      : put(i, std::numeric_limits<T>::infinity(), ~std::uint32_t{0});
        return size_;
    }

private:
    RAYDIX_HD static bool is_after(T d2, std::uint32_t id, T other_d2, std::uint32_t other_id) {
        return d2 > other_d2 || (d2 == other_d2 && id > other_id);
    }
    [[nodiscard]] RAYDIX_HD bool is_after(T d2, std::uint32_t id, std::uint32_t at) const {
        return is_after(d2, id, d2_[at], ids_[at]);
    }
    RAYDIX_HD void put(std::uint32_t at, T d2, std::uint32_t id) {
        d2_[at] = d2;
        ids_[at] = id;
    }
    RAYDIX_HD void move(std::uint32_t from, std::uint32_t to) { put(to, d2_[from], ids_[from]); }
    /// Puts (d2, id) in place of the top of the first `size`.
    RAYDIX_HD void sift_down(T d2, std::uint32_t id, std::uint32_t size) {
        std::uint32_t hole = 0;
        for (std::uint64_t child = 1; child < size; child = 2 * std::uint64_t{hole} + 1) {
            auto next = static_cast<std::uint32_t>(child);
            if (next + 1 < size && is_after(d2_[next + 1], ids_[next + 1], next)) ++next;
            if (!is_after(d2_[next], ids_[next], d2, id)) break;
            move(next, hole);
            hole = next;
        }
        put(hole, d2, id);
    }

    std::uint32_t* ids_;
    T* d2_;
    std::uint32_t k_, size_ = 0;
};

/// Lets element `root` of a heap of `size` sink to its place.
template <class Row>
RAYDIX_HD inline void sink(const Row& row, std::uint32_t root, std::uint32_t size) {
    for (std::uint32_t child = 2 * root + 1; child < size; child = 2 * root + 1) {
        if (child + 1 < size && row.before(child, child + 1)) ++child;
        if (!row.before(root, child)) return;
        row.swap(root, child);
        root = child;
    }
}

/// Sorts elements 0 .. size - 1, fewer than 2^31, by row.before(i, j) with row.swap(i, j).
template <class Row>
RAYDIX_HD inline void heap_sort(const Row& row, std::uint32_t size) {
    for (std::uint32_t root = size / 2; root-- > 0;) sink(row, root, size);
    for (std::uint32_t end = size; end > 1;) {
        row.swap(0, --end);
        sink(row, 0, end);
    }
}

}  // namespace raydix
