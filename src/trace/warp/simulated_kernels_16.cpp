// Kernels on simulated warps of 16 lanes.
#define RAYDIX_SIMULATOR_WIDTH 16
#include "trace/warp/simulated_kernels_of_width.h"
