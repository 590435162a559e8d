// raydix mpi bench weak|strong: nearest points on 1, 2, 4, ... ranks of one run; what is counted
// there, and what a model fitted on at most 8 ranks says of the most ranks, beside their count.
#include "mpi_bench.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <raydix/mpi.h>
#include <semaphore.h>

#include <cmath>
#include <memory>
#include <random>
#include <thread>

#include "mpi_commands.h"
#include "mpi_input.h"
#include "mpi_ranks.h"
#include "option_checks.h"

namespace raydix::cli {
namespace {

/// At most as many ranks of a machine compute at a time as it has processors: each waits for a
/// token. Without it ranks take each other's processors, and their caches.
class ComputeTokens {
public:
    ComputeTokens() {
        MPI_Comm machine;
        MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
        int rank = 0;
        MPI_Comm_rank(machine, &rank);
        long id = getpid();
        MPI_Bcast(&id, 1, MPI_LONG, 0, machine);
        const std::string name = "/raydix-mpi-" + std::to_string(id);
        if (rank == 0) open(name, O_CREAT | O_EXCL);
        MPI_Barrier(machine);
        if (rank != 0) open(name, 0);
        MPI_Barrier(machine);
        if (rank == 0) sem_unlink(name.c_str());
        MPI_Comm_free(&machine);
    }
    ~ComputeTokens() {
        if (tokens_ != SEM_FAILED) sem_close(tokens_);
    }
    ComputeTokens(const ComputeTokens&) = delete;
    ComputeTokens& operator=(const ComputeTokens&) = delete;

    void pass(bool enters) const {
        if (tokens_ == SEM_FAILED) return;
        if (!enters)
            sem_post(tokens_);
        else
            while (sem_wait(tokens_) != 0) {
            }
    }

private:
    void open(const std::string& name, int flags) {
        tokens_ = sem_open(name.c_str(), flags, 0600, std::thread::hardware_concurrency());
    }
    sem_t* tokens_ = SEM_FAILED;
};

constexpr std::uint64_t most_points = 0x7FFFFFFF;  // of a rank; one rank alone has all of them

struct BenchCommand {
    CommonOptions common;
    std::uint64_t points = 1000000, queries = 100000;
    std::uint32_t k = 8;
    std::string cloud = "uniform", partition = "curve", given = "mixed";
    bool weak = true;
    int repeat = 3;
};

/// Rank r of `ranks` gives part r of the cloud; the cloud does not depend on their number if
/// strong.
std::vector<Vec3> make_points(const BenchCommand& options, int rank, int ranks, std::uint64_t n,
                              std::uint64_t stream) {
    std::mt19937_64 random(options.common.seed * 1000003 + stream * 4099 + std::uint64_t(rank));
    std::uniform_real_distribution<float> unit(0, 1);
    std::vector<Vec3> points(n);
    for (Vec3& p : points) {
        p = {unit(random), unit(random), unit(random)};
        if (options.cloud == "clustered") {  // about 64 centers, dense within
            const auto c = static_cast<float>(random() % 64);
            const float r = p.x * p.x * 0.02f;
            p = {std::fmod(c * 0.618034f, 1.0f) + r * (p.y - 0.5f),
                 std::fmod(c * 0.414214f, 1.0f) + r * (p.z - 0.5f),
                 std::fmod(c * 0.732051f, 1.0f) + r * (p.x - 0.5f)};
        }
        // A slab of its own for each rank, as a simulation has it; else anywhere.
        if (options.given == "slabs") p.x = (p.x + float(rank)) / float(ranks);
    }
    return points;
}

double most_of(double value, MPI_Comm comm) {
    MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_MAX, comm);
    return value;
}
double sum_of(double value, MPI_Comm comm) {
    MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_SUM, comm);
    return value;
}

MpiFigures measure(const BenchCommand& options, const ComputeTokens& tokens, MPI_Comm comm) {
    int rank = 0, ranks = 1;
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &ranks);
    const auto share = [&](std::uint64_t n) {
        return options.weak ? n
                            : n * std::uint64_t(rank + 1) / std::uint64_t(ranks) -
                                  n * std::uint64_t(rank) / std::uint64_t(ranks);
    };
    const std::vector<Vec3> points = make_points(options, rank, ranks, share(options.points), 1);
    const std::vector<Vec3> queries = make_points(options, rank, ranks, share(options.queries), 2);
    mpi::Options how;
    how.partition = options.partition == "curve" ? mpi::Partition::curve : mpi::Partition::as_given;
    how.threads = 1;
    how.compute_gate = [&tokens](bool enters) { tokens.pass(enters); };
    const mpi::DistributedPoints spread(comm, points, how);
    MpiFigures figures;
    figures.ranks = ranks;
    figures.compute_s = std::numeric_limits<double>::infinity();
    mpi::NearestRows<float> rows;
    for (int i = 0; i < options.repeat; ++i) {
        rows = spread.knn(queries, options.k);
        figures.compute_s = std::min(figures.compute_s, most_of(rows.report.compute_seconds, comm));
    }
    const mpi::Holding& holding = spread.holding();
    figures.build_s = most_of(holding.report.compute_seconds, comm);
    figures.queries = sum_of(double(queries.size()), comm);
    figures.rows = sum_of(double(rows.counts.found), comm);
    figures.imbalance =
        most_of(double(holding.local), comm) / (sum_of(double(holding.local), comm) / ranks);
    figures.rounds = double(rows.report.rounds);
    figures.messages = sum_of(double(rows.report.traffic.messages), comm);
    figures.bytes = sum_of(double(rows.report.traffic.bytes), comm);
    figures.touched = sum_of(double(rows.report.questions), comm) / figures.queries;
    figures.two_rounds = sum_of(double(rows.report.two_round_questions), comm) / figures.queries;
    figures.replicated_bytes = double(holding.replicated_bytes);
    figures.bytes_per_rank = most_of(double(holding.bytes), comm);
    return figures;
}

/// What a row of k numbers and d2 takes, and a question: of float points.
constexpr double query_bytes = 16, row_bytes = 12;

Json figures_json(const MpiFigures& f, const MpiModel& model) {
    return {{"ranks", f.ranks},
            {"build_compute_s_most", f.build_s},
            {"knn_compute_s_most", f.compute_s},
            {"imbalance", f.imbalance},
            {"rounds", f.rounds},
            {"messages", f.messages},
            {"bytes", f.bytes},
            {"ranks_touched", f.touched},
            {"two_round_ranks_touched", f.two_rounds},
            {"broadcast_bytes", broadcast_bytes(f, query_bytes, row_bytes)},
            {"replicated_bytes", f.replicated_bytes},
            {"bytes_per_rank_most", f.bytes_per_rank},
            {"modelled_s", model.seconds(f)}};
}

constexpr int most_modelled_ranks = 10000;

/// Seconds and bytes of both ways up to many more ranks than there are here.
Json modelled_json(const std::vector<MpiFigures>& counted, const MpiModel& model) {
    std::vector<int> sizes;
    for (int p = 2; p < most_modelled_ranks; p *= 2) sizes.push_back(p);
    sizes.push_back(most_modelled_ranks);
    Json rows = Json::array();
    for (const int ranks : sizes) {
        const MpiFigures forward = predict(counted, ranks);
        const MpiFigures other = broadcast(forward, counted.front(), query_bytes, row_bytes);
        rows.push_back({{"ranks", ranks},
                        {"forwarding_s", model.seconds(forward)},
                        {"forwarding_compute_s", forward.compute_s},
                        {"forwarding_bytes", forward.bytes},
                        {"broadcast_s", model.seconds(other)},
                        {"broadcast_compute_s", other.compute_s},
                        {"broadcast_bytes", other.bytes}});
    }
    return rows;
}

void print_head() {
    fmt::print("{:>6} {:>9} {:>9} {:>9} {:>7} {:>9} {:>12} {:>8} {:>10} {:>14} {:>10} {:>12}\n",
               "ranks", "build s", "knn s", "imbalance", "rounds", "messages", "bytes", "touched",
               "two-round", "broadcast", "replicated", "modelled s");
}
void print_row(const std::string& name, const MpiFigures& f, const MpiModel& model) {
    fmt::print(
        "{:>6} {:>9.3f} {:>9.3f} {:>9.3f} {:>7.1f} {:>9.0f} {:>12.0f} {:>8.3f} {:>10.3f} "
        "{:>14.0f} {:>10.0f} {:>12.4f}\n",
        name, f.build_s, f.compute_s, f.imbalance, f.rounds, f.messages, f.bytes, f.touched,
        f.two_rounds, broadcast_bytes(f, query_bytes, row_bytes), f.replicated_bytes,
        model.seconds(f));
}

/// Compute of the slowest rank where every rank is alone with what it gives, all at the same time:
/// what sharing the machine costs without any messages.
double measure_alone(const BenchCommand& options, const ComputeTokens& tokens) {
    return most_of(measure(options, tokens, MPI_COMM_SELF).compute_s, MPI_COMM_WORLD);
}

/// Figures of 1, 2, 4, ... ranks, and of all.
std::vector<MpiFigures> measure_all(const BenchCommand& options, const ComputeTokens& tokens) {
    std::vector<MpiFigures> all;
    std::vector<int> sizes;
    for (int p = 1; p < mpi_ranks(); p *= 2) sizes.push_back(p);
    sizes.push_back(mpi_ranks());
    for (const int p : sizes) {
        MPI_Comm some;
        MPI_Comm_split(MPI_COMM_WORLD, mpi_rank() < p ? 0 : MPI_UNDEFINED, mpi_rank(), &some);
        if (some != MPI_COMM_NULL) {
            all.push_back(measure(options, tokens, some));
            MPI_Comm_free(&some);
        }
        MPI_Barrier(MPI_COMM_WORLD);
    }
    return all;
}

void run_bench(const BenchCommand& options) {
    const MpiModel model;
    const ComputeTokens tokens;
    const double alone = options.weak ? measure_alone(options, tokens) : 0;
    const std::vector<MpiFigures> counted = measure_all(options, tokens);
    on_first([&] {
        Json document = new_document(options.weak ? "mpi bench weak" : "mpi bench strong");
        document["cloud"] = options.cloud;
        document["given"] = options.given;
        document["partition"] = options.partition;
        document["seed"] = options.common.seed;
        document["points"] = options.points;
        document["queries"] = options.queries;
        document["k"] = options.k;
        document["model"] = {{"latency_s", model.latency_s}, {"bytes_per_s", model.bytes_per_s}};
        const bool prints = options.common.prints_tables();
        if (prints) {
            fmt::print(
                "knn, k {}, {} points and {} queries {}, {}, {}, {}; processor seconds of "
                "the slowest rank\n",
                options.k, options.points, options.queries, options.weak ? "a rank" : "in all",
                options.cloud, options.given, options.partition);
            print_head();
        }
        if (options.weak) document["alone_compute_s_most"] = alone;
        std::vector<MpiFigures> fitted;
        for (const MpiFigures& f : counted) {
            if (prints) print_row(std::to_string(f.ranks), f, model);
            document["counted"].push_back(figures_json(f, model));
            if (f.ranks <= 8 && f.ranks > 1 && f.ranks < mpi_ranks()) fitted.push_back(f);
        }
        if (fitted.size() >= 2) {
            const MpiFigures predicted = predict(fitted, mpi_ranks());
            document["predicted"] = figures_json(predicted, model);
            if (prints) print_row("fit", predicted, model);
        }
        if (counted.size() >= 3) document["modelled"] = modelled_json(counted, model);
        if (prints && options.weak)
            fmt::print("alone: {:.3f} s with every rank alone at the same time.\n", alone);
        if (prints && fitted.size() >= 2)
            fmt::print("fit: predicted for {} ranks from 2 to {}.\n", mpi_ranks(),
                       fitted.back().ranks);
        if (prints)
            fmt::print(
                "two-round: the nearest rank, then all that its answer leaves, itself again.\n"
                "broadcast: bytes if every query went to every rank. modelled s: {} s a message, "
                "{:g} bytes a second, both chosen.\n",
                model.latency_s, model.bytes_per_s);
        write_json(document, options.common);
    });
}

}  // namespace

void add_mpi_bench(CLI::App& app) {
    CLI::App* bench = app.add_subcommand("bench", "Nearest points on 1, 2, 4, ... ranks of a run");
    bench->require_subcommand(1);
    for (const bool weak : {true, false}) {
        CLI::App* command = bench->add_subcommand(
            weak ? "weak" : "strong", weak ? "As many points a rank" : "As many points in all");
        auto options = std::make_shared<BenchCommand>();
        options->weak = weak;
        add_common_options(*command, options->common);
        command->add_option(weak ? "--per-rank" : "--points", options->points, "Points")
            ->transform(whole_number(1, most_points))
            ->capture_default_str();
        command->add_option("--queries", options->queries, "Queries, counted as points are")
            ->transform(whole_number(1, most_points))
            ->capture_default_str();
        command->add_option("--k", options->k, "Neighbours")
            ->transform(whole_number(1, 0xFFFFFFFE))
            ->capture_default_str();
        command->add_option("--cloud", options->cloud, "The cloud")
            ->check(CLI::IsMember({"uniform", "clustered"}))
            ->capture_default_str();
        command->add_option("--given", options->given, "Where the points of a rank lie")
            ->check(CLI::IsMember({"mixed", "slabs"}))
            ->capture_default_str();
        command->add_option("--partition", options->partition, "Which rank holds what")
            ->check(CLI::IsMember({"curve", "as_given"}))
            ->capture_default_str();
        command->add_option("--repeat", options->repeat, "Calls; the least time counts")
            ->transform(whole_number(1, 10000))
            ->capture_default_str();
        command->callback([options, command] {
            require_writable_results(*command, options->common, "", "");
            run_bench(*options);
        });
    }
}

}  // namespace raydix::cli
