// Kernels on simulated warps of 1 lane.
#define RAYDIX_SIMULATOR_WIDTH 1
#include "trace/warp/simulated_kernels_of_width.h"
