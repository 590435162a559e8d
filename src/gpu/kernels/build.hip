// Kernels of the LBVH family, as clang compiles them to SPIR-V for OpenCL and to code
// objects for AMD.
#include "gpu/kernels/entry.h"
#include "gpu/device_build.h"

namespace raydix {
#include "gpu/kernels/build.inc"
}
