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

    /// Seconds of a call: the slowest rank's compute; of an average rank rounds of messages and
    /// their bytes; and the bytes of the tree that each rank gathers once.
    [[nodiscard]] double seconds(const MpiFigures& figures) const;
};

/// Figures for `ranks` from those of fewer: lines over the logarithm of the number of ranks, or
/// powers of it where these are nearer to what was counted. Of messages it is the number between
/// two ranks that is continued so, of bytes that of a query. From at least two figures with more
/// than one rank.
[[nodiscard]] MpiFigures predict(const std::vector<MpiFigures>& counted, int ranks);

/// The other way, with a full answer of every rank to every query, for as many ranks, queries and
/// rows as `figures`. Each rank answers as fast as `alone` answered its own queries.
[[nodiscard]] MpiFigures broadcast(const MpiFigures& figures, const MpiFigures& alone,
                                   double query_bytes, double row_bytes);

/// Bytes that would travel if every query went to every rank, each with a full answer.
[[nodiscard]] double broadcast_bytes(const MpiFigures& figures, double query_bytes,
                                     double row_bytes);

}  // namespace raydix::cli
