// What raydix mpi bench counts and what it says of more ranks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace raydix::cli {

/// Counted on one number of ranks.
struct MpiFigures {
    int ranks = 1;
    double build_s = 0, compute_s = 0;  // processor seconds of the slowest rank
    double imbalance = 1;               // the most points of a rank over the mean
    double rounds = 0, messages = 0, bytes = 0;
    double touched = 1;     // ranks that a query asks, on average
    double two_rounds = 1;  // the same of two rounds that ask the nearest rank again
    double replicated_bytes = 0, bytes_per_rank = 0;
    double queries = 0, rows = 0;  // of all ranks
};

/// Constants of the model, which are chosen and not measured.
struct MpiModel {
    double latency_s = 2e-6;
    double bytes_per_s = 1e10;

    /// Seconds of a call: the slowest rank's compute and, of an average rank, rounds of messages
    /// and their bytes.
    [[nodiscard]] double seconds(const MpiFigures& figures) const;
};

/// Figures for `ranks` from those of fewer: lines over the logarithm of the number of ranks. Of
/// messages it is the number between two ranks that grows so, of bytes that of a query; replicated
/// bytes and queries grow as powers. From at least two figures with more than one rank.
[[nodiscard]] MpiFigures predict(const std::vector<MpiFigures>& counted, int ranks);

/// Bytes that would travel if every query went to every rank, each with a full answer.
[[nodiscard]] double broadcast_bytes(const MpiFigures& figures, double query_bytes,
                                     double row_bytes);

}  // namespace raydix::cli
