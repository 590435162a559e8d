#if defined(RAYDIX_HAVE_HIP)

#include "exec/code_object.h"

#include <array>

#include RAYDIX_CODE_OBJECT_LIST

// The files as they are, as symbols: raydix_code_NAME and, behind them, raydix_code_NAME_end.
#define RAYDIX_EMBED(name)                                                                      \
    asm(".pushsection .rodata\n.balign 4096\n.hidden raydix_code_" #name                        \
        "\n.globl raydix_code_" #name "\nraydix_code_" #name                                    \
        ":\n.incbin \"" RAYDIX_CODE_OBJECT_FOLDER "/" #name ".co\"\n.hidden raydix_code_" #name \
        "_end\n.globl raydix_code_" #name "_end\nraydix_code_" #name "_end:\n.popsection");     \
    extern "C" [[gnu::visibility("hidden")]] const char raydix_code_##name[];                   \
    extern "C" [[gnu::visibility("hidden")]] const char raydix_code_##name##_end[];
RAYDIX_CODE_OBJECTS(RAYDIX_EMBED)

namespace raydix {
namespace {

struct Embedded {
    std::string_view name;
    const char *begin, *end;
};
#define RAYDIX_EMBEDDED(name) Embedded{#name, raydix_code_##name, raydix_code_##name##_end},
const std::array all = {RAYDIX_CODE_OBJECTS(RAYDIX_EMBEDDED)};

}  // namespace

std::span<const char> code_object(std::string_view architecture) {
    for (const Embedded& e : all)
        if (e.name == architecture) return {e.begin, e.end};
    return {};
}

std::string code_object_names() {
    std::string names;
    for (const Embedded& e : all) names += (names.empty() ? "" : ", ") + std::string(e.name);
    return names;
}

}  // namespace raydix

#endif
