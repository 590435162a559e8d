// Results of any length (CSR) that were made piece by piece -> one array a column.
#pragma once

#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/result_limit.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "arrays.h"

namespace raydix::python {

/// Bytes of some columns of a piece.
template <class Piece, class... Columns>
[[nodiscard]] std::uint64_t piece_bytes(const Piece& piece, Columns Piece::*... column) {
    return (... + ((piece.*column).size() * sizeof(*(piece.*column).data())));
}

/// The limit `max_result_bytes` over pieces that are held until they are joined.
class PieceLimit {
public:
    PieceLimit(const char* what, std::uint64_t max_result_bytes)
        : what_(what), limit_(max_result_bytes) {}

    /// call(max_result_bytes) -> a piece, which may take what the ones before have left.
    template <class Call>
    auto next(const Call& call) {
        if (held_ == 0) return call(limit_);
        if (limit_ == 0) limit_ = usual_result_bytes() + held_ / 2;  // as before the first piece
        if (held_ >= limit_) throw ResultTooLarge(what_, limit_, false, limit_);
        try {
            return call(limit_ - held_);
        } catch (const ResultTooLarge& error) {
            throw ResultTooLarge(what_, held_ + error.bytes(), error.is_exact(), limit_);
        }
    }
    void hold(std::uint64_t bytes) { held_ += bytes; }
    /// Beside the pieces for a while: a whole column.
    void require(std::uint64_t column_bytes) const {
        require_result_bytes(what_, held_ + column_bytes, limit_);
    }

private:
    const char* what_;
    std::uint64_t limit_, held_ = 0;
};

/// Throws ResultTooLarge where the longest column does not fit beside all pieces. A single piece
/// gives its columns away.
template <class Piece, class... Columns>
void require_room_to_join(const PieceLimit& limit, const std::vector<Piece>& pieces,
                          Columns Piece::*... column) {
    if (pieces.size() < 2) return;
    std::uint64_t longest = 0;
    const auto measure = [&](auto one) {
        std::uint64_t bytes = 0;
        for (const Piece& piece : pieces) bytes += piece_bytes(piece, one);
        longest = std::max(longest, bytes);
    };
    (measure(column), ...);
    limit.require(longest);
}

/// offsets [queries + 1] of all pieces, one after the other. The pieces keep theirs empty.
template <class Piece>
[[nodiscard]] Array1<std::uint64_t> join_offsets(std::vector<Piece>& pieces) {
    if (pieces.size() == 1) return hand_over(std::move(pieces[0].offsets));
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
