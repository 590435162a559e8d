#include "exec/spirv_module.h"

#include <raydix/error.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
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
constexpr std::uint32_t header_words = 5, bound_word = 3;
enum Op : std::uint32_t {
    source = 3,
    entry_point = 15,
    execution_mode = 16,
    capability = 17,
    constant = 43,
    control_barrier = 224,
    memory_barrier = 225,
    atomic_load = 227,
    atomic_store = 228,
    atomic_exchange = 229,
    atomic_compare_exchange = 230,
    atomic_compare_exchange_weak = 231,
    atomic_xor = 242,  // the last of those that read, change and write
};
// Memory semantics: acquire, release, both, or one order for all; and what memory is ordered.
constexpr std::uint32_t orders = 0x2 | 0x4 | 0x8 | 0x10;
constexpr std::uint32_t device_memory = 0x100 | 0x200;  // of work-groups, and across them
constexpr std::uint32_t cpp_for_opencl = 4, cpp_version = 100000;
constexpr std::uint32_t subgroup_size_mode = 35, subgroup_dispatch = 58;

bool is_of_warps(const std::uint32_t* entry, std::span<const std::string_view> prefixes) {
    const std::string_view name(reinterpret_cast<const char*>(entry + 3));
    return std::ranges::any_of(prefixes, [&](std::string_view p) { return name.starts_with(p); });
}

void broken_if(bool is) {
    if (is) throw DeviceError("a SPIR-V module of this build is broken");
}

/// visit(op, instruction) for each.
template <class Visit>
void each_instruction(std::span<const std::uint32_t> words, const Visit& visit) {
    broken_if(words.size() < header_words);
    for (std::size_t at = header_words; at < words.size();) {
        const std::uint32_t size = words[at] >> 16;
        broken_if(size == 0 || size > words.size() - at);
        visit(words[at] & 0xFFFF, words.subspan(at, size));
        at += size;
    }
}

/// The words of an instruction that name its memory semantics: [begin, end).
struct SemanticsWords {
    std::uint32_t begin = 0, end = 0;
};
SemanticsWords semantics_of(std::uint32_t op) {
    if (op == Op::memory_barrier) return {2, 3};
    if (op == Op::control_barrier || op == Op::atomic_store) return {3, 4};
    if (op == Op::atomic_compare_exchange || op == Op::atomic_compare_exchange_weak) return {5, 7};
    if (op == Op::atomic_load || (op >= Op::atomic_exchange && op <= Op::atomic_xor)) return {5, 6};
    return {};
}

/// Constants that say how memory is ordered, but not which -> constants that say both.
class OrderedMemory {
public:
    explicit OrderedMemory(std::span<const std::uint32_t> words) {
        each_instruction(words, [&](std::uint32_t op, std::span<const std::uint32_t> given) {
            const auto [begin, end] = semantics_of(op);
            broken_if(end > given.size());
            for (std::uint32_t k = begin; k < end; ++k) ordered_[given[k]] = given[k];
        });
    }

    /// Behind a constant that is used so: the one that takes its place, with the next free id.
    void complete(std::span<const std::uint32_t> given, std::vector<std::uint32_t>& out) {
        const auto used = given.size() == 4 ? ordered_.find(given[2]) : ordered_.end();
        if (used == ordered_.end() || (given[3] & orders) == 0) return;
        used->second = out[bound_word]++;
        out.insert(out.end(), {given[0], given[1], used->second, given[3] | device_memory});
    }
    [[nodiscard]] std::uint32_t of(std::uint32_t id) const { return ordered_.at(id); }

private:
    std::map<std::uint32_t, std::uint32_t> ordered_;
};

}  // namespace

std::vector<std::uint32_t> complete_spirv(std::span<const std::uint32_t> words,
                                          std::span<const std::string_view> warp_prefixes) {
    OrderedMemory memory(words);
    std::vector<std::uint32_t> out(words.begin(), words.begin() + header_words);
    out.insert(out.end(), {2u << 16 | Op::capability, subgroup_dispatch});
    std::vector<std::uint32_t> in_warps;
    each_instruction(words, [&](std::uint32_t op, std::span<const std::uint32_t> given) {
        if (op == Op::entry_point) {
            if (is_of_warps(given.data(), warp_prefixes)) in_warps.push_back(given[2]);
        } else {
            // Execution modes stand right behind the entry points.
            for (const std::uint32_t kernel : in_warps)
                out.insert(out.end(),
                           {4u << 16 | Op::execution_mode, kernel, subgroup_size_mode, 32u});
            in_warps.clear();
        }
        const std::size_t start = out.size();
        out.insert(out.end(), given.begin(), given.end());
        if (op == Op::source) {
            out[start + 1] = cpp_for_opencl;
            out[start + 2] = cpp_version;
        }
        if (op == Op::constant) memory.complete(given, out);
        const auto [begin, end] = semantics_of(op);
        for (std::uint32_t k = begin; k < end; ++k) out[start + k] = memory.of(given[k]);
    });
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
