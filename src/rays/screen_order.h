// The order in which primary rays visit the screen: 2-D Morton order, so that neighbours in a batch
// are neighbours in space. width, height -> pixel ids [width * height], id = y * width + x.
#pragma once

#include <cstdint>
#include <vector>

namespace raydix {

/// Pixels by the code that interleaves x and y, x in the lower bit of each pair: (0,0) (1,0) (0,1)
/// (1,1) (2,0) ... Pixels outside the screen take no code, and whole squares outside are passed
/// over at once.
[[nodiscard]] std::vector<std::uint32_t> pixels_in_morton_order(std::uint32_t width,
                                                                std::uint32_t height);

}  // namespace raydix
