// The kernel of Aila and Laine with work queues, as clang compiles it to SPIR-V for OpenCL and to
// code objects for AMD.
#include "gpu/kernels/trace_entry.h"

namespace raydix {
#include "gpu/kernels/queue.inc"
}
