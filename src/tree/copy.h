// A tree with the same arrays, for those who change one while others read it.
#pragma once

#include <raydix/double.h>

namespace raydix {

[[nodiscard]] BvhD copy_of(const BvhD& from);

}  // namespace raydix
