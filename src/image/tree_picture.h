// What the pictures of trees share: levels as parts of a colour map, masks laid over a picture.
#pragma once

#include <raydix/picture.h>
#include <raydix/tree_view.h>

#include <algorithm>
#include <span>

#include "base/math.h"
#include "report/line_mask.h"

namespace raydix {

/// The first and the last level of some boxes.
struct LevelScale {
    std::uint32_t first = 0xFFFFFFFFu, last = 0;

    explicit LevelScale(std::span<const LevelBox> boxes) {
        for (const LevelBox& b : boxes) {
            first = std::min(first, b.level);
            last = std::max(last, b.level);
        }
    }
    /// How far a level lies between them: 0..1.
    [[nodiscard]] float part(std::uint32_t level) const {
        return last > first ? static_cast<float>(level - first) / static_cast<float>(last - first)
                            : 0.0f;
    }
};

/// Lays `colour` over the picture where the mask is not 0.
inline void blend(Picture& picture, const LineMask& mask, Vec3 colour, float strength) {
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        const float part = strength * mask.coverage()[i];
        if (part > 0.0f) picture.pixels[i] = (1.0f - part) * picture.pixels[i] + part * colour;
    }
}

}  // namespace raydix
