// Points and scenes spread over the ranks of an MPI communicator. Answers have the bits of one
// process that holds everything, for every number of ranks and every partition
// (docs/distributed.md).
//
// This header needs <mpi.h> and the library raydix_mpi (CMake: raydix::mpi). MPI must have been
// started with MPI_THREAD_FUNNELED or more; all calls come from the thread that started it.
//
// Every call that says "collective" must be made by all ranks of the communicator, in the same
// order. Each rank gives its own queries, any number of them or none, and gets their answers in its
// own order. An error on one rank is thrown on all: the same type, and a message that begins with
// that rank. Ranks whose calls or options differ get an InputError that names two of them.
#pragma once

#include <mpi.h>
#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/points.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/types.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

namespace raydix::mpi {

/// MPI itself failed. The message names the MPI call.
class CommunicationError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Stands in 64-bit numbers for "nothing was found".
inline constexpr std::uint64_t no_global = std::numeric_limits<std::uint64_t>::max();

/// Which rank holds what. Answers do not depend on it.
enum class Partition : std::uint32_t {
    as_given = 0,  // each rank keeps what it gave
    curve = 1,     // all is sorted along one Morton curve; each rank holds a run of about equal
                   // length. Queries then reach few ranks
};

struct Options {
    Partition partition = Partition::curve;
    bool strict = false;  // true: what would be left out is an InputError
    int threads = 0;      // of each rank: 0 to 1,024; 0: all the machine has
    /// The most bytes that a rank takes in during a round, questions or answers, one long answer
    /// aside. Fewer bytes mean more rounds.
    std::uint64_t exchange_bytes = std::uint64_t{64} << 20;
    std::uint64_t message_bytes = std::uint64_t{1} << 20;  // the most of one message
    /// Boxes around what a rank holds that every rank knows. More boxes make queries reach fewer
    /// ranks for nothing, and cost memory on all: 1 to 4,096.
    std::uint32_t boxes_per_rank = 32;
    /// Called with true before a rank computes and with false after it; must not throw. For
    /// programs with more ranks than processors, which may hold a rank back.
    std::function<void(bool)> compute_gate = {};
};

/// What this rank sent to others.
struct Traffic {
    std::uint64_t messages = 0, bytes = 0;  // between two ranks, of questions, answers and parts
    std::uint64_t collectives = 0;          // calls that all ranks take part in
};

/// What a call took, on this rank.
struct CallReport {
    std::uint64_t rounds = 0;
    std::uint64_t questions = 0;  // asked of ranks, this one included
    std::uint64_t answered = 0;   // questions of all ranks that this one answered
    Traffic traffic;
    double compute_seconds = 0;  // processor time of all threads, waiting for others left out
};

/// What an object holds, on this rank and on all.
struct Holding {
    std::uint64_t size = 0, left_out = 0;  // of all ranks: elements given, and those left out
    std::uint64_t local = 0;               // elements that this rank holds
    std::uint64_t first = 0;               // the number of the first element that this rank gave
    std::uint64_t replicated_bytes = 0;    // of the tree over the boxes of all ranks
    std::uint64_t bytes = 0;               // that queries read on this rank
    CallReport report;                     // of the construction
};

struct QueryOptions {
    bool sort = false;  // true: rows by (distance, number). false: by number
    /// The most bytes that the result may take on this rank. 0: half of what is left to the process
    /// (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};

/// As raydix::NearestPoints, with numbers that count through the ranks.
template <class Scalar>
struct NearestRows {
    Buffer<std::uint64_t> indices;  // [queries * k]; no_global behind the last point
    Buffer<Scalar> distances;       // [queries * k]; infinity behind the last point
    PointQueryCounts counts;        // of this rank's queries
    CallReport report;
};

/// As raydix::PointLists, with numbers that count through the ranks.
template <class Scalar>
struct PointRows {
    Buffer<std::uint64_t> offsets;  // [queries + 1]
    Buffer<std::uint64_t> indices;
    Buffer<Scalar> distances;
    PointQueryCounts counts;
    CallReport report;
};

/// Points in 3-D spread over ranks. Point i of rank r has the number i + (points that the ranks
/// before r gave). Move-only. To destroy it is collective too, while MPI runs.
template <class Scalar>
class BasicDistributedPoints {
public:
    using Index = PointIndex<Scalar, 3>;
    using Point = typename Index::Point;
    using Box = typename Index::Box;

    /// Collective. Points that are not finite or have a coordinate beyond 1e12 are left out and
    /// counted. Throws InputError: 2^31 points or more on one rank, an option out of range.
    BasicDistributedPoints(MPI_Comm comm, std::span<const Point> points,
                           const Options& options = {});
    ~BasicDistributedPoints();
    BasicDistributedPoints(BasicDistributedPoints&&) noexcept;
    BasicDistributedPoints& operator=(BasicDistributedPoints&&) noexcept;

    [[nodiscard]] const Holding& holding() const;

    /// Collective. The k nearest points of each query by (d2, number), as raydix::knn. All ranks
    /// give the same k. Throws InputError: k = 0. Throws ResultTooLarge before the result is
    /// allocated.
    [[nodiscard]] NearestRows<Scalar> knn(std::span<const Point> queries, std::uint32_t k,
                                          const QueryOptions& options = {}) const;
    /// Collective. All points with d2 <= R*R, as raydix::radius_search. All ranks give the same
    /// radius and `sort`.
    [[nodiscard]] PointRows<Scalar> radius(std::span<const Point> queries, Scalar radius,
                                           const QueryOptions& options = {}) const;
    /// Collective. All points in each closed box, ascending, as raydix::box_search.
    [[nodiscard]] PointRows<Scalar> box(std::span<const Box> boxes,
                                        const QueryOptions& options = {}) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};
extern template class BasicDistributedPoints<float>;
extern template class BasicDistributedPoints<double>;
using DistributedPoints = BasicDistributedPoints<float>;
using DistributedPointsD = BasicDistributedPoints<double>;

}  // namespace raydix::mpi
