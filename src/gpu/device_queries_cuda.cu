// Queries of device_queries.h, and names of hits, on a CUDA stream.
#include "gpu/cuda_machine.cuh"
#include "gpu/launched_queries.h"

template class raydix::LaunchedQueries<raydix::CudaMachine>;
