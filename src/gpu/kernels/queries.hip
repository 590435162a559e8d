// Kernels of queries and of the names of hits, as clang compiles them to SPIR-V for OpenCL and to
// code objects for AMD.
#include "gpu/kernels/entry.h"
#include "engine/name_hit.h"
#include "gpu/device_queries.h"

namespace raydix {
#include "gpu/kernels/queries.inc"
}
