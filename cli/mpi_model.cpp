#include <algorithm>
#include <cmath>

#include "mpi_bench.h"

namespace raydix::cli {
namespace {

/// The least squares line y = a + b x at `at`.
double line_at(const std::vector<double>& x, const std::vector<double>& y, double at) {
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
    return (sy - slope * sx) / n + slope * at;
}

/// How many messages a round can send one way.
double pairs_of(int ranks) { return double(ranks) * (ranks - 1.0); }

}  // namespace

double MpiModel::seconds(const MpiFigures& figures) const {
    const double ranks = figures.ranks;
    return figures.compute_s +
           latency_s * (figures.messages / ranks + 3 * figures.rounds * std::log2(ranks)) +
           figures.bytes / ranks / bytes_per_s;
}

MpiFigures predict(const std::vector<MpiFigures>& counted, int ranks) {
    const double at = std::log2(double(ranks));
    const auto extend = [&](const auto& value_of) {
        std::vector<double> x, y;
        for (const MpiFigures& one : counted) {
            if (one.ranks == 1) continue;  // nothing travels there
            x.push_back(std::log2(double(one.ranks)));
            y.push_back(value_of(one));
        }
        return std::max(line_at(x, y, at), 0.0);
    };
    MpiFigures predicted;
    predicted.ranks = ranks;
    for (const auto figure :
         {&MpiFigures::build_s, &MpiFigures::compute_s, &MpiFigures::imbalance, &MpiFigures::rounds,
          &MpiFigures::touched, &MpiFigures::two_rounds, &MpiFigures::bytes_per_rank})
        predicted.*figure = extend([&](const MpiFigures& f) { return f.*figure; });
    for (const auto figure :
         {&MpiFigures::replicated_bytes, &MpiFigures::queries, &MpiFigures::rows})
        predicted.*figure = std::exp2(
            extend([&](const MpiFigures& f) { return std::log2(std::max(f.*figure, 1.0)); }));
    predicted.messages = pairs_of(ranks) *
                         extend([](const MpiFigures& f) { return f.messages / pairs_of(f.ranks); });
    predicted.bytes =
        predicted.queries * extend([](const MpiFigures& f) { return f.bytes / f.queries; });
    return predicted;
}

double broadcast_bytes(const MpiFigures& figures, double query_bytes, double row_bytes) {
    return (figures.ranks - 1.0) * (figures.queries * query_bytes + figures.rows * row_bytes);
}

}  // namespace raydix::cli
