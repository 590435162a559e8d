// Kernels of scans and sorts, as clang compiles them to SPIR-V for OpenCL and to code objects for
// AMD.
#include "gpu/kernels/entry.h"
#include "exec/arithmetic_check.h"
#include "exec/warp_sort.h"

namespace raydix {
#include "gpu/kernels/sort.inc"
}
