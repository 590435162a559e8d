#include "mpi/call.h"

#include <raydix/error.h>

#include <cstdio>
#include <limits>

#include "base/options.h"

namespace raydix::mpi {

void check_options(const Options& options) {
    check_enum("partition", options.partition, Partition::curve);
    check_threads(options.threads);
    const std::uint64_t most = std::numeric_limits<int>::max();
    if (options.message_bytes == 0 || options.message_bytes > most)
        throw InputError("option message_bytes is " + std::to_string(options.message_bytes) +
                         "; it must be 1 to " + std::to_string(most));
    if (options.boxes_per_rank == 0 || options.boxes_per_rank > 4096)
        throw InputError("option boxes_per_rank is " + std::to_string(options.boxes_per_rank) +
                         "; it must be 1 to 4096");
}

std::string describe(const Options& options, const char* scalar) {
    return std::string(scalar) + ", partition " +
           (options.partition == Partition::curve ? "curve" : "as_given") + ", exchange_bytes " +
           std::to_string(options.exchange_bytes) + ", message_bytes " +
           std::to_string(options.message_bytes) + (options.strict ? ", strict" : "");
}

std::string exact_text(double value) {
    char text[40];
    std::snprintf(text, sizeof(text), "%.17g", value);
    return text;
}

}  // namespace raydix::mpi
