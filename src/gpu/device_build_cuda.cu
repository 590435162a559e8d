// Builds of device_build.h on a CUDA stream.
#include "gpu/cuda_machine.cuh"
#include "gpu/launched_builds.h"

template class raydix::LaunchedBuilds<raydix::CudaMachine>;
