// Walks the quadtree over the smallest square power of two that holds the screen.
#include "rays/screen_order.h"

#include <algorithm>
#include <bit>

namespace raydix {
namespace {

struct Walk {
    std::uint32_t width, height;
    std::vector<std::uint32_t>& pixels;

    void visit(std::uint32_t x, std::uint32_t y, std::uint32_t side) {
        if (x >= width || y >= height) return;
        if (side == 1) {
            pixels.push_back(y * width + x);
            return;
        }
        const std::uint32_t half = side / 2;
        visit(x, y, half);
        visit(x + half, y, half);
        visit(x, y + half, half);
        visit(x + half, y + half, half);
    }
};

}  // namespace

std::vector<std::uint32_t> pixels_in_morton_order(std::uint32_t width, std::uint32_t height) {
    std::vector<std::uint32_t> pixels;
    pixels.reserve(std::size_t{width} * height);
    Walk{width, height, pixels}.visit(0, 0, std::bit_ceil(std::max(width, height)));
    return pixels;
}

}  // namespace raydix
