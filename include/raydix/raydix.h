// Everything at once.
#pragma once

#include <raydix/buffer.h>           // IWYU pragma: export
#include <raydix/bvh.h>              // IWYU pragma: export
#include <raydix/camera.h>           // IWYU pragma: export
#include <raydix/check.h>            // IWYU pragma: export
#include <raydix/closest.h>          // IWYU pragma: export
#include <raydix/cwbvh.h>            // IWYU pragma: export
#include <raydix/device.h>           // IWYU pragma: export
#include <raydix/device_cwbvh.h>     // IWYU pragma: export
#include <raydix/device_trace.h>     // IWYU pragma: export
#include <raydix/device_trees.h>     // IWYU pragma: export
#include <raydix/error.h>            // IWYU pragma: export
#include <raydix/hierarchy_study.h>  // IWYU pragma: export
#include <raydix/instances.h>        // IWYU pragma: export
#include <raydix/kdtree.h>           // IWYU pragma: export
#include <raydix/machine.h>          // IWYU pragma: export
#include <raydix/mesh.h>             // IWYU pragma: export
#include <raydix/octree.h>           // IWYU pragma: export
#include <raydix/overlap.h>          // IWYU pragma: export
#include <raydix/pairs.h>            // IWYU pragma: export
#include <raydix/picture.h>          // IWYU pragma: export
#include <raydix/rays.h>             // IWYU pragma: export
#include <raydix/rdx.h>              // IWYU pragma: export
#include <raydix/refit.h>            // IWYU pragma: export
#include <raydix/report.h>           // IWYU pragma: export
#include <raydix/scene.h>            // IWYU pragma: export
#include <raydix/shapes.h>           // IWYU pragma: export
#include <raydix/simulate.h>         // IWYU pragma: export
#include <raydix/solid.h>            // IWYU pragma: export
#include <raydix/trace.h>            // IWYU pragma: export
#include <raydix/tree_view.h>        // IWYU pragma: export
#include <raydix/types.h>            // IWYU pragma: export
#include <raydix/user_geometry.h>    // IWYU pragma: export
#include <raydix/version.h>          // IWYU pragma: export
#include <raydix/wide.h>             // IWYU pragma: export
