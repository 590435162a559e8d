// What a launch over a compressed wide tree refuses.
#pragma once

#include "gpu/backend.h"

namespace raydix {

/// Throws InputError: an unknown kernel, too many rays, too deep a tree, too little scratch, memory
/// that is not aligned.
void check_cwbvh_launch(const DeviceBackend::CwbvhCall& call);

}  // namespace raydix
