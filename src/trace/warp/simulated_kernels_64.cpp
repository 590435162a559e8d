// Kernels on simulated warps of 64 lanes.
#define RAYDIX_SIMULATOR_WIDTH 64
#include "trace/warp/simulated_kernels_of_width.h"
