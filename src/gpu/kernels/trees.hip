// Kernels of k-d trees and octrees, as clang compiles them to SPIR-V for OpenCL and to code objects
// for AMD.
#include "gpu/kernels/entry.h"
#include "gpu/device_trees.h"

namespace raydix {
#include "gpu/kernels/trees.inc"
}
