// Kernels on simulated warps of 8 lanes.
#define RAYDIX_SIMULATOR_WIDTH 8
#include "trace/warp/simulated_kernels_of_width.h"
