// What a code object for AMD says of itself: the target and the kernels of its metadata note
// (MessagePack), each with the symbol of its descriptor. Standard library and <elf.h> only.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace raydix::standin {

struct KernelNote {
    std::uint64_t arguments = 0;         // of kernels
    std::uint64_t argument_bytes = 0;    // of the first, which is given by value at offset 0
    std::uint64_t argument_segment = 0;  // .kernarg_segment_size: hidden ones included
    std::uint64_t most_threads = 0;      // .max_flat_workgroup_size
    std::string symbol;                  // of its descriptor: NAME.kd
};
struct CodeObject {
    std::string target;  // amdgcn-amd-amdhsa--gfx90a
    std::map<std::string, KernelNote> kernels;
};

/// Nothing if the bytes are no code object of 64-bit AMDGPU, or one whose kernels have no symbols.
[[nodiscard]] std::optional<CodeObject> read_code_object(const char* image);

}  // namespace raydix::standin
