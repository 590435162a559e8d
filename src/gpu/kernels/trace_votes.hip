// The other kernels of Aila and Laine, as clang compiles them to SPIR-V for OpenCL and to code
// objects for AMD.
#include "gpu/kernels/trace_entry.h"

namespace raydix {
#include "gpu/kernels/trace_votes.inc"
}
