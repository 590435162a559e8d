// The expert's floor: builders and binary trees with their statistics and checks, octree and k-d
// tree, layouts, refits, files and queries of one tree, devices, the simulator and the report.
// Scenes of raydix/raydix.h stand on it.
#pragma once

#include <raydix/bvh.h>              // IWYU pragma: export
#include <raydix/check.h>            // IWYU pragma: export
#include <raydix/closest.h>          // IWYU pragma: export
#include <raydix/cwbvh.h>            // IWYU pragma: export
#include <raydix/device.h>           // IWYU pragma: export
#include <raydix/device_cwbvh.h>     // IWYU pragma: export
#include <raydix/device_queries.h>   // IWYU pragma: export
#include <raydix/device_scene.h>     // IWYU pragma: export
#include <raydix/device_trace.h>     // IWYU pragma: export
#include <raydix/device_trees.h>     // IWYU pragma: export
#include <raydix/double.h>           // IWYU pragma: export
#include <raydix/hierarchy_study.h>  // IWYU pragma: export
#include <raydix/kdtree.h>           // IWYU pragma: export
#include <raydix/machine.h>          // IWYU pragma: export
#include <raydix/octree.h>           // IWYU pragma: export
#include <raydix/overlap.h>          // IWYU pragma: export
#include <raydix/pairs.h>            // IWYU pragma: export
#include <raydix/rdx.h>              // IWYU pragma: export
#include <raydix/refit.h>            // IWYU pragma: export
#include <raydix/report.h>           // IWYU pragma: export
#include <raydix/simulate.h>         // IWYU pragma: export
#include <raydix/trace.h>            // IWYU pragma: export
#include <raydix/tree_view.h>        // IWYU pragma: export
#include <raydix/wide.h>             // IWYU pragma: export
