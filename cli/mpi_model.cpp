#include <algorithm>
#include <cmath>

#include "mpi_bench.h"

namespace raydix::cli {
namespace {

/// Values over the logarithm of ranks, continued as a line or as a power, whichever is nearer to
/// them.
class Growth {
public:
    void add(double x, double y) {
        x_.push_back(x);
        y_.push_back(y);
        log_y_.push_back(std::log2(std::max(y, 1e-300)));
    }
    [[nodiscard]] double at(double x) const {
        const auto line = [&](double place) { return line_at(x_, y_, place); };
        const auto power = [&](double place) { return std::exp2(line_at(x_, log_y_, place)); };
        return std::max(error_of(power) < error_of(line) ? power(x) : line(x), 0.0);
    }

private:
    /// The least squares line y = a + b x at `place`.
    static double line_at(const std::vector<double>& x, const std::vector<double>& y,
                          double place) {
        double sx = 0, sy = 0, sxx = 0, sxy = 0;
        const auto n = double(x.size());
        for (std::size_t i = 0; i < x.size(); ++i) {
            sx += x[i];
            sy += y[i];
            sxx += x[i] * x[i];
            sxy += x[i] * y[i];
        }
        const double spread = n * sxx - sx * sx;
        const double slope = spread > 0 ? (n * sxy - sx * sy) / spread : 0;
        return (sy - slope * sx) / n + slope * place;
    }
    template <class Curve>
    [[nodiscard]] double error_of(const Curve& curve) const {
        double sum = 0;
        for (std::size_t i = 0; i < x_.size(); ++i)
            sum += (curve(x_[i]) - y_[i]) * (curve(x_[i]) - y_[i]);
        return sum;
    }
    std::vector<double> x_, y_, log_y_;
};

/// How many messages a round can send one way.
double pairs_of(int ranks) { return double(ranks) * (ranks - 1.0); }

}  // namespace

double MpiModel::seconds(const MpiFigures& figures) const {
    const double ranks = figures.ranks;
    return figures.compute_s +
           latency_s * (figures.messages / ranks + 3 * figures.rounds * std::log2(ranks)) +
           (figures.bytes / ranks + figures.replicated_bytes) / bytes_per_s;
}

MpiFigures predict(const std::vector<MpiFigures>& counted, int ranks) {
    const double at = std::log2(double(ranks));
    const auto extend = [&](const auto& value_of) {
        Growth growth;
        for (const MpiFigures& one : counted)
            if (one.ranks > 1) growth.add(std::log2(double(one.ranks)), value_of(one));
        return growth.at(at);  // of one rank nothing travels
    };
    MpiFigures predicted;
    predicted.ranks = ranks;
    for (const auto figure :
         {&MpiFigures::build_s, &MpiFigures::compute_s, &MpiFigures::imbalance, &MpiFigures::rounds,
          &MpiFigures::touched, &MpiFigures::two_rounds, &MpiFigures::bytes_per_rank,
          &MpiFigures::replicated_bytes, &MpiFigures::queries, &MpiFigures::rows})
        predicted.*figure = extend([&](const MpiFigures& f) { return f.*figure; });
    predicted.messages = pairs_of(ranks) *
                         extend([](const MpiFigures& f) { return f.messages / pairs_of(f.ranks); });
    predicted.bytes =
        predicted.queries * extend([](const MpiFigures& f) { return f.bytes / f.queries; });
    return predicted;
}

MpiFigures broadcast(const MpiFigures& figures, const MpiFigures& alone, double query_bytes,
                     double row_bytes) {
    MpiFigures other;
    other.ranks = figures.ranks;
    other.compute_s = alone.compute_s / alone.queries * figures.queries;
    other.rounds = 1;
    other.messages = 2 * pairs_of(figures.ranks);
    other.bytes = broadcast_bytes(figures, query_bytes, row_bytes);
    other.touched = other.two_rounds = figures.ranks;
    other.queries = figures.queries;
    other.rows = figures.rows;
    return other;
}

double broadcast_bytes(const MpiFigures& figures, double query_bytes, double row_bytes) {
    return (figures.ranks - 1.0) * (figures.queries * query_bytes + figures.rows * row_bytes);
}

}  // namespace raydix::cli
