// tree_hash of an LBVH over the triangles of all ranks: one Morton grid, one global sort, the nodes
// that begin on each rank, and their words to rank 0, rank by rank, which hashes them.
#include <raydix/error.h>
#include <raydix/mpi.h>

#include <limits>
#include <string>

#include "base/float_env.h"
#include "base/options.h"
#include "mpi/agree.h"
#include "mpi/curve.h"
#include "mpi/spread_lbvh.h"
#include "primitives/bounds.h"
#include "tree/bvh_stream.h"
#include "tree/code_options.h"
#include "tree/lbvh_family.h"
#include "tree/word_hash.h"

namespace raydix::mpi {
namespace {

constexpr std::size_t piece_words = std::size_t{1} << 16;
constexpr int words_tag = 3, turn_tag = 4;

void check_tree_options(const BuildOptions& options) {
    check_threads(options.threads);
    if (!follows_codes(options))
        throw InputError(
            "tree_hash over ranks: the builder must be karras, lauterbach, garanzha or apetrei, "
            "without reinsertion; others look at more than sorted codes");
    check_code_options(options);
}

/// Around what all ranks have.
Aabb joined(const Communicator& comm, const Aabb& mine) {
    double least[6] = {mine.lo.x,          mine.lo.y,          mine.lo.z,
                       -double(mine.hi.x), -double(mine.hi.y), -double(mine.hi.z)};
    comm.reduce(least, 6, MPI_MIN);
    const auto back = [](double x) { return static_cast<float>(x); };
    return {{back(least[0]), back(least[1]), back(least[2])},
            {back(-least[3]), back(-least[4]), back(-least[5])}};
}

/// Words go to rank 0 in pieces of one size, the last of which is shorter.
class WordsToFirst {
public:
    explicit WordsToFirst(const Communicator& comm) : comm_(comm) { words_.reserve(piece_words); }
    void put(std::uint32_t word) {
        words_.push_back(word);
        if (words_.size() == piece_words) send();
    }
    void put(Vec3 p) {
        for (const float x : {p.x, p.y, p.z}) put(std::bit_cast<std::uint32_t>(x));
    }
    void send() {
        check_mpi(MPI_Send(words_.data(), static_cast<int>(words_.size()), MPI_UINT32_T, 0,
                           words_tag, comm_.handle()),
                  "MPI_Send");
        comm_.count_message(words_.size() * sizeof(std::uint32_t));
        words_.clear();
    }

private:
    const Communicator& comm_;
    std::vector<std::uint32_t> words_;
};

/// The triangles of this rank: sorted along the curve with those of all others.
template <class Key>
class TreeOverRanks {
public:
    TreeOverRanks(const Communicator& comm, const MeshView& mesh, const BuildOptions& options)
        : comm_(comm), options_(options) {
        std::exception_ptr error;
        const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(),
                                    mesh.vertices.size()};
        const std::uint64_t before = comm.sum_before(mesh.triangles.size());
        Bounds bounds;
        keep_error(error, [&] {
            with_threads(options.threads, [&] {
                bounds = scene_bounds(source, static_cast<std::uint32_t>(mesh.triangles.size()));
            });
            check(bounds, before + mesh.triangles.size());
        });
        agree(comm, error);
        const Grid grid = make_grid(joined(comm, bounds.box), CodeFormat<Key>::axis_bits);
        std::vector<CurveKey> keys;
        keep_error(error, [&] {
            for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
                SortedPrimitive one;
                if (!source.box(i, one.box)) continue;
                one.code = interleave<Key>(grid.cell(center_of(one.box)));
                one.id = static_cast<std::uint32_t>(before) + i;
                run_.push_back(one);
                keys.push_back({one.code, one.id});
            }
        });
        agree(comm, error);
        run_ = partition_by_curve(comm, std::move(run_), keys, message_bytes);
        std::sort(run_.begin(), run_.end(), [](const auto& a, const auto& b) {
            return std::tuple(a.code, a.id) < std::tuple(b.code, b.id);
        });
    }

    /// Collective.
    [[nodiscard]] std::string hash() {
        tree_.emplace(comm_, run_, static_cast<std::uint32_t>(options_.max_leaf));
        std::optional<WordHash> words;
        std::optional<WordsToFirst> sender;
        together(comm_, [&] {
            nodes_ = tree_->reversed_nodes();
            if (comm_.rank() == 0)
                words.emplace();
            else
                sender.emplace(comm_);
        });
        if (comm_.rank() != 0) {
            std::uint32_t skipped = 0;
            check_mpi(
                MPI_Recv(&skipped, 1, MPI_UINT32_T, 0, turn_tag, comm_.handle(), MPI_STATUS_IGNORE),
                "MPI_Recv");
            skipped = put_nodes(*sender, skipped);
            sender->put(skipped);
            sender->send();
            return comm_.broadcast({}, 0);
        }
        put_bvh_head(*words, options_.bits, options_.max_leaf);
        std::uint32_t skipped = put_nodes(*words, 0);
        for (int r = 1; r < comm_.size(); ++r) skipped = take_turn(*words, r, skipped);
        return comm_.broadcast(words->hex(), 0);
    }

private:
    static constexpr std::uint64_t message_bytes = std::uint64_t{1} << 20;

    void check(const Bounds& bounds, std::uint64_t triangles) const {
        if (triangles >= std::uint64_t{1} << 31)
            throw InputError(std::to_string(triangles) +
                             " triangles; a tree takes fewer than 2147483648");
        if (bounds.first_unreadable != no_primitive)
            throw InputError("triangle " + std::to_string(bounds.first_unreadable) +
                             " refers to a vertex that is not there");
        if (options_.strict && bounds.left_out != 0)
            throw InputError("triangle " + std::to_string(bounds.first_left_out) +
                             " is not finite or out of range");
    }

    /// The words of this rank's nodes. The first `skipped` primitives are in a leaf that the ranks
    /// before have put; gives how many of the ranks behind are in one that is put here.
    template <class Out>
    std::uint32_t put_nodes(Out& out, std::uint32_t skipped) const {
        std::size_t at = 0;
        std::vector<std::uint32_t> ids;
        for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) {
            if (node->count > static_cast<std::uint32_t>(options_.max_leaf)) {
                put_inner_node(out, node->box.lo, node->box.hi);
                continue;
            }
            if (skipped > 0) {
                --skipped;
            } else {
                ids.clear();
                for (std::uint32_t k = 0; k < node->count; ++k) ids.push_back(tree_->id(at + k));
                put_leaf_node(out, node->box.lo, node->box.hi, ids);
                skipped = node->count - 1;
            }
            ++at;
        }
        return skipped;
    }

    /// On rank 0: hashes what rank r sends, the last word aside, which says what it skips behind.
    std::uint32_t take_turn(WordHash& hash, int r, std::uint32_t skipped) const {
        check_mpi(MPI_Send(&skipped, 1, MPI_UINT32_T, r, turn_tag, comm_.handle()), "MPI_Send");
        std::vector<std::uint32_t> words(piece_words);
        std::optional<std::uint32_t> last;
        for (int count = static_cast<int>(piece_words); count == static_cast<int>(piece_words);) {
            MPI_Status status;
            check_mpi(MPI_Recv(words.data(), static_cast<int>(piece_words), MPI_UINT32_T, r,
                               words_tag, comm_.handle(), &status),
                      "MPI_Recv");
            MPI_Get_count(&status, MPI_UINT32_T, &count);
            for (int i = 0; i < count; ++i) {
                if (last) hash.put(*last);
                last = words[std::size_t(i)];
            }
        }
        return last.value();
    }

    const Communicator& comm_;
    BuildOptions options_;
    std::vector<SortedPrimitive> run_;
    std::optional<SpreadLbvh<Key>> tree_;
    std::vector<SpreadNode> nodes_;
};

}  // namespace

std::string tree_hash(MPI_Comm given, const MeshView& mesh, const BuildOptions& options) {
    const FloatEnvironment plain;
    const Communicator comm(given);
    together_on(comm,
                "tree_hash, " + std::to_string(options.bits) + " bits, max_leaf " +
                    std::to_string(options.max_leaf) + (options.strict ? ", strict" : ""),
                [&] {
                    check_tree_options(options);
                    if (mesh.triangles.size() >= std::size_t{1} << 31)
                        throw InputError(std::to_string(mesh.triangles.size()) +
                                         " triangles; a tree takes fewer than 2147483648");
                });
    if (options.bits == 30) return TreeOverRanks<std::uint32_t>(comm, mesh, options).hash();
    return TreeOverRanks<std::uint64_t>(comm, mesh, options).hash();
}

}  // namespace raydix::mpi
