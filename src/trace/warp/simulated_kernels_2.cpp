// Kernels on simulated warps of 2 lanes.
#define RAYDIX_SIMULATOR_WIDTH 2
#include "trace/warp/simulated_kernels_of_width.h"
