// Builds, other trees, queries and names of hits on a queue of OpenCL or HIP.
#if defined(RAYDIX_HAVE_QUEUES)

#include "gpu/launched_builds.h"
#include "gpu/launched_queries.h"
#include "gpu/launched_trees.h"
#include "gpu/queue_machine.h"

template class raydix::LaunchedBuilds<raydix::QueueMachine>;
template class raydix::LaunchedTrees<raydix::QueueMachine>;
template class raydix::LaunchedQueries<raydix::QueueMachine>;

#endif
