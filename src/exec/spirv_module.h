// The SPIR-V that clang made of the kernels, as drivers want it.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace raydix {

/// The words of a module: build, sort, trace ... Throws BackendUnavailable if this build has none
/// of that name.
[[nodiscard]] std::vector<std::uint32_t> spirv_module(std::string_view name);

/// Three things that clang leaves out of HIP-language code. Kernels whose names begin with one of
/// `warp_prefixes` run in sub-groups of 32. The source is C++ for OpenCL, without which Intel's
/// driver takes atomics on generic pointers for those of OpenCL C 1. Fences, barriers and atomics
/// that order memory name the memory that they order, that of work-groups and that across them:
/// without a name they order none.
[[nodiscard]] std::vector<std::uint32_t> complete_spirv(
    std::span<const std::uint32_t> words, std::span<const std::string_view> warp_prefixes);

}  // namespace raydix
