// Everything at once.
#pragma once

#include <raydix/arrays.h>           // IWYU pragma: export
#include <raydix/buffer.h>           // IWYU pragma: export
#include <raydix/bvh.h>              // IWYU pragma: export
#include <raydix/camera.h>           // IWYU pragma: export
#include <raydix/check.h>            // IWYU pragma: export
#include <raydix/cwbvh.h>            // IWYU pragma: export
#include <raydix/device.h>           // IWYU pragma: export
#include <raydix/device_cwbvh.h>     // IWYU pragma: export
#include <raydix/device_trace.h>     // IWYU pragma: export
#include <raydix/device_trees.h>     // IWYU pragma: export
#include <raydix/error.h>            // IWYU pragma: export
#include <raydix/hierarchy_study.h>  // IWYU pragma: export
#include <raydix/kdtree.h>           // IWYU pragma: export
#include <raydix/machine.h>          // IWYU pragma: export
#include <raydix/mesh.h>             // IWYU pragma: export
#include <raydix/octree.h>           // IWYU pragma: export
#include <raydix/picture.h>          // IWYU pragma: export
#include <raydix/points.h>           // IWYU pragma: export
#include <raydix/rays.h>             // IWYU pragma: export
#include <raydix/rdx.h>              // IWYU pragma: export
#include <raydix/report.h>           // IWYU pragma: export
#include <raydix/scene.h>            // IWYU pragma: export
#include <raydix/simulate.h>         // IWYU pragma: export
#include <raydix/trace.h>            // IWYU pragma: export
#include <raydix/tree_view.h>        // IWYU pragma: export
#include <raydix/types.h>            // IWYU pragma: export
#include <raydix/version.h>          // IWYU pragma: export
#include <raydix/wide.h>             // IWYU pragma: export
