// The run of `bench cpu`: scene by scene, workload by workload, from where an earlier run stopped.
#pragma once

#include "cpu_options.h"

namespace raydix::bench {

/// Prints tables as it goes and writes the document after each workload. Throws InputError: a
/// scene that cannot be read, a document of other options to go on with.
void run_study(const CpuBench& options);

}  // namespace raydix::bench
