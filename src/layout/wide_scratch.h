// What making a wide tree works in, kept from one tree to the next.
#pragma once

#include "layout/sorted_part.h"
#include "layout/wide_bvh.h"
#include "layout/wide_part.h"

namespace raydix {

/// Of trees made from sorted triangles.
struct SortedScratch {
    Buffer<std::uint64_t> kept_bits;
    Buffer<std::uint32_t> kept_before;
    TopBuffers top;
    std::vector<PartRoot> roots;  // [parts]
    // One for each thread.
    std::vector<PartEntries<4>> entries4;
    std::vector<PartEntries<8>> entries8;
};

struct WideScratch::Memory {
    PartPool pool;
    SortedScratch sorted;
};

}  // namespace raydix
