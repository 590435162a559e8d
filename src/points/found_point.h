// A point that a query found, and the orders of rows that are too long for the kernels.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace raydix {

template <class T>
struct FoundPoint {
    T d2;
    std::uint32_t id;
};

/// By id, or by (d2, id).
template <class T>
void sort_found(std::vector<FoundPoint<T>>& row, bool by_distance) {
    using Point = FoundPoint<T>;
    if (by_distance)
        std::sort(row.begin(), row.end(), [](const Point& a, const Point& b) {
            return a.d2 < b.d2 || (a.d2 == b.d2 && a.id < b.id);
        });
    else
        std::sort(row.begin(), row.end(),
                  [](const Point& a, const Point& b) { return a.id < b.id; });
}

}  // namespace raydix
