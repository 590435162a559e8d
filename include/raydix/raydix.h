// What most programs need: models, scenes and their rays and queries, points, pictures, files.
// The trees themselves, devices and the simulator have headers of their own, all of which are in
// raydix/expert.h. MPI is in raydix/mpi.h.
#pragma once

#include <raydix/arrays.h>         // IWYU pragma: export
#include <raydix/batch.h>          // IWYU pragma: export
#include <raydix/buffer.h>         // IWYU pragma: export
#include <raydix/camera.h>         // IWYU pragma: export
#include <raydix/error.h>          // IWYU pragma: export
#include <raydix/files.h>          // IWYU pragma: export
#include <raydix/mesh.h>           // IWYU pragma: export
#include <raydix/model.h>          // IWYU pragma: export
#include <raydix/picture.h>        // IWYU pragma: export
#include <raydix/points.h>         // IWYU pragma: export
#include <raydix/quality.h>        // IWYU pragma: export
#include <raydix/rays.h>           // IWYU pragma: export
#include <raydix/rdx_scene.h>      // IWYU pragma: export
#include <raydix/result_limit.h>   // IWYU pragma: export
#include <raydix/scene.h>          // IWYU pragma: export
#include <raydix/scene_info.h>     // IWYU pragma: export
#include <raydix/scene_pairs.h>    // IWYU pragma: export
#include <raydix/scene_queries.h>  // IWYU pragma: export
#include <raydix/shapes.h>         // IWYU pragma: export
#include <raydix/solid.h>          // IWYU pragma: export
#include <raydix/surface.h>        // IWYU pragma: export
#include <raydix/thread_pool.h>    // IWYU pragma: export
#include <raydix/transform.h>      // IWYU pragma: export
#include <raydix/types.h>          // IWYU pragma: export
#include <raydix/user_geometry.h>  // IWYU pragma: export
#include <raydix/version.h>        // IWYU pragma: export
