#include "exec/spirv_module.h"

#include <raydix/error.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#if defined(RAYDIX_HAVE_OPENCL)

#include RAYDIX_SPIRV_LIST

// The files as they are, as symbols: raydix_spirv_NAME and, behind them, raydix_spirv_NAME_end.
#define RAYDIX_EMBED(name)                                                                         \
    asm(".pushsection .rodata\n.balign 4\n.hidden raydix_spirv_" #name                             \
        "\n.globl raydix_spirv_" #name "\nraydix_spirv_" #name ":\n.incbin \"" RAYDIX_SPIRV_FOLDER \
        "/" #name ".spv\"\n.hidden raydix_spirv_" #name "_end\n.globl raydix_spirv_" #name         \
        "_end\nraydix_spirv_" #name "_end:\n.popsection");                                         \
    extern "C" [[gnu::visibility("hidden")]] const std::uint32_t raydix_spirv_##name[];            \
    extern "C" [[gnu::visibility("hidden")]] const std::uint32_t raydix_spirv_##name##_end[];
RAYDIX_SPIRV_MODULES(RAYDIX_EMBED)

#endif

namespace raydix {
namespace {

// SPIR-V 1.4, sections 2.3 and 3.
constexpr std::uint32_t header_words = 5;
enum Op : std::uint32_t { source = 3, entry_point = 15, execution_mode = 16, capability = 17 };
constexpr std::uint32_t cpp_for_opencl = 4, cpp_version = 100000;
constexpr std::uint32_t subgroup_size_mode = 35, subgroup_dispatch = 58;

bool is_of_warps(const std::uint32_t* entry, std::span<const std::string_view> prefixes) {
    const std::string_view name(reinterpret_cast<const char*>(entry + 3));
    return std::ranges::any_of(prefixes, [&](std::string_view p) { return name.starts_with(p); });
}

}  // namespace

std::vector<std::uint32_t> complete_spirv(std::span<const std::uint32_t> words,
                                          std::span<const std::string_view> warp_prefixes) {
    const auto broken = [](bool is) {
        if (is) throw DeviceError("a SPIR-V module of this build is broken");
    };
    broken(words.size() < header_words);
    std::vector<std::uint32_t> out(words.begin(), words.begin() + header_words);
    out.insert(out.end(), {2u << 16 | Op::capability, subgroup_dispatch});
    std::vector<std::uint32_t> in_warps;
    for (std::size_t at = header_words; at < words.size();) {
        const std::uint32_t size = words[at] >> 16, op = words[at] & 0xFFFF;
        broken(size == 0 || size > words.size() - at);
        if (op == Op::entry_point) {
            if (is_of_warps(&words[at], warp_prefixes)) in_warps.push_back(words[at + 2]);
        } else {
            // Execution modes stand right behind the entry points.
            for (const std::uint32_t kernel : in_warps)
                out.insert(out.end(),
                           {4u << 16 | Op::execution_mode, kernel, subgroup_size_mode, 32u});
            in_warps.clear();
        }
        const std::size_t start = out.size();
        out.insert(out.end(), words.begin() + static_cast<std::ptrdiff_t>(at),
                   words.begin() + static_cast<std::ptrdiff_t>(at + size));
        if (op == Op::source) {
            out[start + 1] = cpp_for_opencl;
            out[start + 2] = cpp_version;
        }
        at += size;
    }
    return out;
}

#if defined(RAYDIX_HAVE_OPENCL)

std::vector<std::uint32_t> spirv_module(std::string_view name) {
    struct Embedded {
        std::string_view name;
        const std::uint32_t *begin, *end;
    };
#define RAYDIX_EMBEDDED(name) Embedded{#name, raydix_spirv_##name, raydix_spirv_##name##_end},
    static const std::array all = {RAYDIX_SPIRV_MODULES(RAYDIX_EMBEDDED)};
    for (const Embedded& e : all)
        if (e.name == name) return {e.begin, e.end};
    throw BackendUnavailable("device opencl: this build has no kernels for " + std::string(name));
}

#endif

}  // namespace raydix
