// Kernels on simulated warps of 32 lanes.
#define RAYDIX_SIMULATOR_WIDTH 32
#include "trace/warp/simulated_kernels_of_width.h"
