#include "mpi/curve.h"

namespace raydix::mpi {
namespace {

/// Every rank takes each of its keys that is a whole number of steps from its first. A part between
/// two splitters is then off by at most one step of each rank, at either end: 2 ranks^2 / samples
/// of a fair part. 64 a rank and rank make that 1/32.
constexpr std::uint64_t samples_per_pair = 64;
/// Of all ranks together: 16 MB on each.
constexpr std::uint64_t most_samples = std::uint64_t{1} << 20;

std::vector<CurveKey> sample(const std::vector<CurveKey>& keys, std::uint64_t step) {
    std::vector<CurveKey> samples;
    for (std::uint64_t i = step / 2; i < keys.size(); i += step) samples.push_back(keys[i]);
    return samples;
}

}  // namespace

std::vector<std::size_t> split_curve(const Communicator& comm, const std::vector<CurveKey>& keys) {
    const auto ranks = static_cast<std::uint64_t>(comm.size());
    std::uint64_t total = keys.size();
    comm.reduce(&total, 1, MPI_SUM);
    const std::uint64_t wanted = std::min(samples_per_pair * ranks * ranks, most_samples);
    const std::uint64_t step = std::max<std::uint64_t>(total / wanted, 1);
    std::vector<CurveKey> samples = comm.gather(sample(keys, step));
    std::sort(samples.begin(), samples.end());
    std::vector<std::size_t> begins{0};
    for (std::uint64_t r = 1; r < ranks; ++r) {
        const std::uint64_t place = samples.size() * r / ranks;
        const auto begin = place < samples.size()
                               ? std::lower_bound(keys.begin(), keys.end(), samples[place])
                               : keys.end();
        begins.push_back(std::size_t(begin - keys.begin()));
    }
    begins.push_back(keys.size());
    return begins;
}

}  // namespace raydix::mpi
