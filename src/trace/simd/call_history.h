// What the rays of a thread's single calls have in common: whether the next one will probably take
// the way of the last.
#pragma once

#include <cstdint>

namespace raydix {

struct CallHistory {
    alignas(16) float origin[4] = {};  // of the last ray
    std::uint32_t ray_class = 0;       // of the last ray: ray_classes.h
    int agreeing = 0;  // 0 to most: how many of the last rays were like those before

    static constexpr int most = 8, enough = 4;
    /// Of the scene's size, along each axis: origins of neighbours are no farther apart.
    static constexpr float near = 1.0f / 16;

    void add(bool like_the_last) {
        if (like_the_last)
            agreeing += agreeing < most ? 1 : 0;
        else
            agreeing -= agreeing < 2 ? agreeing : 2;
    }
    [[nodiscard]] bool is_coherent() const { return agreeing >= enough; }
};

}  // namespace raydix
