// k-d trees and octrees of device_trees.h on a CUDA stream.
#include "gpu/cuda_machine.cuh"
#include "gpu/launched_trees.h"

template class raydix::LaunchedTrees<raydix::CudaMachine>;
