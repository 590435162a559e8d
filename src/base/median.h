// The median of some numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace raydix {

/// Of an even number the upper one in the middle. `values`: at least one; comes back in another
/// order.
inline double median(std::vector<double>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace raydix
