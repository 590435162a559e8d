// Builds, other trees, queries and names of hits on an OpenCL queue.
#if defined(RAYDIX_HAVE_OPENCL)

#include "gpu/launched_builds.h"
#include "gpu/launched_queries.h"
#include "gpu/launched_trees.h"
#include "gpu/opencl_machine.h"

template class raydix::LaunchedBuilds<raydix::OpenclMachine>;
template class raydix::LaunchedTrees<raydix::OpenclMachine>;
template class raydix::LaunchedQueries<raydix::OpenclMachine>;

#endif
