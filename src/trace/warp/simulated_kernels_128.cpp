// Kernels on simulated warps of 128 lanes.
#define RAYDIX_SIMULATOR_WIDTH 128
#include "trace/warp/simulated_kernels_of_width.h"
