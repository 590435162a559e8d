// Results of any length (CSR) that were made piece by piece -> one array a column.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "arrays.h"

namespace raydix::python {

/// offsets [queries + 1] of all pieces, one after the other. The pieces keep theirs empty.
template <class Piece>
[[nodiscard]] Array1<std::uint64_t> join_offsets(std::vector<Piece>& pieces) {
    std::size_t queries = 0;
    for (const Piece& piece : pieces) queries += piece.offsets.size() - 1;
    Buffer<std::uint64_t> joined(queries + 1);
    std::uint64_t base = 0;
    std::size_t row = 0;
    for (Piece& piece : pieces) {
        const std::size_t rows = piece.offsets.size() - 1;
        for (std::size_t i = 0; i < rows; ++i) joined[row++] = base + piece.offsets[i];
        base += piece.offsets[rows];
        piece.offsets = {};
    }
    joined[row] = base;
    return hand_over(std::move(joined));
}

/// One column of all pieces. A single piece gives its memory away; of several, each is freed when
/// it has been copied, so that the peak is the result and one piece.
template <class Piece, class Values>
[[nodiscard]] Values join_column(std::vector<Piece>& pieces, Values Piece::*column) {
    if (pieces.size() == 1) return std::move(pieces[0].*column);
    std::size_t size = 0;
    for (const Piece& piece : pieces) size += (piece.*column).size();
    Values joined(size);
    std::size_t at = 0;
    for (Piece& piece : pieces) {
        Values values = std::move(piece.*column);
        if (values.size() != 0)
            std::memcpy(joined.data() + at, values.data(), values.size() * sizeof(*values.data()));
        at += values.size();
    }
    return joined;
}

}  // namespace raydix::python
