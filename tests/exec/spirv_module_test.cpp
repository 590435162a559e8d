// What completes a module: on words written out here, as sections 2.3 and 3 of SPIR-V 1.4 lay them.
#include "exec/spirv_module.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <array>
#include <cstring>
#include <string>

namespace raydix {
namespace {

using Words = std::vector<std::uint32_t>;
constexpr std::array<std::string_view, 2> prefixes = {"warps_", "tiles_"};

Words header() { return {0x07230203, 0x00010400, 0, 9, 0}; }
Words instruction(std::uint32_t op, const Words& operands) {
    Words words = {static_cast<std::uint32_t>(operands.size() + 1) << 16 | op};
    words.insert(words.end(), operands.begin(), operands.end());
    return words;
}
Words capability(std::uint32_t which) { return instruction(17, {which}); }
Words memory_model() { return instruction(14, {2, 2}); }
Words entry_point(std::uint32_t id, const std::string& name) {
    Words operands = {6, id};
    operands.resize(2 + name.size() / 4 + 1);
    std::memcpy(&operands[2], name.data(), name.size());
    return instruction(15, operands);
}
Words execution_mode(std::uint32_t id, std::uint32_t mode) { return instruction(16, {id, mode}); }
Words sub_groups_of_32(std::uint32_t id) { return instruction(16, {id, 35, 32}); }
Words source(std::uint32_t language, std::uint32_t version) {
    return instruction(3, {language, version});
}
Words module_of(const std::vector<Words>& instructions) {
    Words words = header();
    for (const Words& one : instructions) words.insert(words.end(), one.begin(), one.end());
    return words;
}

TEST(CompleteSpirv, KernelsOfWarpsRunInSubGroupsOf32) {
    const Words given = module_of({capability(6),
                                   memory_model(),
                                   entry_point(1, "each_a"),
                                   entry_point(2, "warps_b"),
                                   entry_point(3, "tiles_of_more"),
                                   entry_point(4, "a_warps_"),
                                   execution_mode(1, 31),
                                   execution_mode(2, 31),
                                   source(3, 200000),
                                   {5u << 16 | 19, 1, 2, 3, 4}});
    const Words expected = module_of({capability(58),
                                      capability(6),
                                      memory_model(),
                                      entry_point(1, "each_a"),
                                      entry_point(2, "warps_b"),
                                      entry_point(3, "tiles_of_more"),
                                      entry_point(4, "a_warps_"),
                                      sub_groups_of_32(2),
                                      sub_groups_of_32(3),
                                      execution_mode(1, 31),
                                      execution_mode(2, 31),
                                      source(4, 100000),
                                      {5u << 16 | 19, 1, 2, 3, 4}});
    EXPECT_EQ(complete_spirv(given, prefixes), expected);
}

TEST(CompleteSpirv, WithoutAnyExecutionModeToo) {
    const Words given = module_of({memory_model(), entry_point(7, "warps_x"), source(3, 0)});
    EXPECT_EQ(complete_spirv(given, prefixes),
              module_of({capability(58), memory_model(), entry_point(7, "warps_x"),
                         sub_groups_of_32(7), source(4, 100000)}));
}

TEST(CompleteSpirv, WithoutWarpsOnlyTheLanguageChanges) {
    const Words given = module_of({memory_model(), entry_point(7, "warps_x"), source(3, 0)});
    EXPECT_EQ(complete_spirv(given, {}), module_of({capability(58), memory_model(),
                                                    entry_point(7, "warps_x"), source(4, 100000)}));
    EXPECT_EQ(complete_spirv(header(), prefixes), module_of({capability(58)}));
}

TEST(CompleteSpirv, BrokenModulesAreRefused) {
    Words words = module_of({memory_model(), entry_point(7, "warps_x"), source(3, 0)});
    for (std::size_t size = 0; size < words.size(); ++size) {
        // Cut between instructions it is a module, elsewhere not.
        const bool whole = size == 5 || size == 8 || size == 13;
        const std::span<const std::uint32_t> cut(words.data(), size);
        if (whole)
            EXPECT_NO_THROW(static_cast<void>(complete_spirv(cut, prefixes))) << size;
        else
            EXPECT_THROW(static_cast<void>(complete_spirv(cut, prefixes)), DeviceError) << size;
    }
    words[5] = 14;  // an instruction of no words
    EXPECT_THROW(static_cast<void>(complete_spirv(words, prefixes)), DeviceError);
}

}  // namespace
}  // namespace raydix
