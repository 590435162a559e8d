#pragma once

namespace raydix {

inline constexpr const char* version = "0.1.0";

}  // namespace raydix
