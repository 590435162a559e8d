// A round's partners -> the list of the next one, but for the boxes of merged clusters: which
// clusters of a block stay, and which of those merge.
#pragma once

#include <array>
#include <cstdint>

#include "tree/cluster.h"
#include "tree/nearest_cluster.h"

namespace raydix {

/// The places of a block that stay, and which of them merge, as positions in that list.
struct Survivors {
    static constexpr std::size_t room = partner_block + 16;  // vectors are stored as they are
    std::array<std::uint32_t, room> places;
    std::array<std::uint32_t, room> pairs;
    std::uint32_t count = 0, pair_count = 0;
};

/// A list and where a part of the next one begins: lanes of boxes, and names. No names: the places
/// of primitives.
struct ListCopy {
    std::array<const float*, 6> lanes;
    const ClusterRef* refs;
    std::array<float*, 6> to_lanes;
    ClusterRef* to_refs;
};

/// For places [begin, end), at most partner_block. A cluster stays if its partner is none or to its
/// right, and is copied. Found without a branch: nobody can guess which clusters merge.
void keep_survivors(const std::int8_t* partners, std::uint32_t begin, std::uint32_t end,
                    const ListCopy& copy, Survivors& out);

/// The same with sixteen places at once or one; the answer does not depend on it. `wide` only if
/// has_wide_survivors().
void keep_survivors(const std::int8_t* partners, std::uint32_t begin, std::uint32_t end,
                    const ListCopy& copy, Survivors& out, bool wide);
[[nodiscard]] bool has_wide_survivors();

}  // namespace raydix
