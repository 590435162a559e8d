// Kernels on simulated warps of 4 lanes.
#define RAYDIX_SIMULATOR_WIDTH 4
#include "trace/warp/simulated_kernels_of_width.h"
