// How good a tree is to be.
#pragma once

namespace raydix {

/// What a tree is for: built each frame, built once for some million rays, built once for many.
enum class Quality { fast, balanced, high };

}  // namespace raydix
