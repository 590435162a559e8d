// The kernels of Aila and Laine, and the launches before and behind them, as clang compiles them to
// SPIR-V for OpenCL and to code objects for AMD.
#include "gpu/kernels/trace_entry.h"
#include "engine/name_hit.h"
#include "gpu/trace_launches.h"

namespace raydix {
#include "gpu/kernels/trace.inc"
#include "gpu/kernels/trace_around.inc"
}
