// What completes a module: on words written out here, as sections 2.3 and 3 of SPIR-V 1.4 lay them,
// and on the modules of this build.
#include "exec/spirv_module.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
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

/// constant(type, id, value); the ids below 9 are the module's own, those from 9 on are added.
Words constant(std::uint32_t id, std::uint32_t value) { return instruction(43, {1, id, value}); }

TEST(CompleteSpirv, WhatOrdersMemorySaysWhichMemory) {
    const auto module = [](const std::vector<Words>& added, std::uint32_t acquire_release,
                           std::uint32_t acquire, std::uint32_t bound) {
        std::vector<Words> all = {capability(6), memory_model(), constant(2, 1), constant(3, 8)};
        if (!added.empty()) all.push_back(added[0]);
        all.push_back(constant(4, 2));
        if (!added.empty()) all.push_back(added[1]);
        for (const Words& one :
             {constant(5, 0), constant(6, 4), instruction(225, {2, acquire_release}),
              instruction(224, {2, 2, acquire_release}), instruction(227, {1, 7, 8, 2, acquire}),
              instruction(228, {8, 2, acquire_release, 7}),
              instruction(229, {1, 7, 8, 2, acquire_release, 7}),
              instruction(230, {1, 7, 8, 2, acquire_release, acquire, 7, 7}),
              instruction(234, {1, 7, 8, 2, 5, 6}),  // relaxed
              instruction(241, {1, 7, 8, 2, acquire_release, 3})})
            all.push_back(one);
        Words words = module_of(all);
        words[3] = bound;
        return words;
    };
    Words expected = module({constant(9, 0x308), constant(10, 0x302)}, 9, 10, 11);
    const Words sub_groups = capability(58);
    expected.insert(expected.begin() + 5, sub_groups.begin(), sub_groups.end());
    EXPECT_EQ(complete_spirv(module({}, 3, 4, 9), prefixes), expected);
}

#if defined(RAYDIX_HAVE_OPENCL)
/// In no module is a fence, a barrier or an atomic left that orders no memory.
TEST(CompleteSpirv, EveryModuleOfThisBuildOrdersMemory) {
    const std::string all = RAYDIX_SPIRV_NAMES;
    std::size_t ordering = 0;
    for (std::size_t at = 0, end = 0; at < all.size(); at = end + 1) {
        end = std::min(all.find(' ', at), all.size());
        const std::string name = all.substr(at, end - at);
        const Words words = complete_spirv(spirv_module(name), prefixes);
        std::map<std::uint32_t, std::uint32_t> constants;
        for (std::size_t i = 5; i < words.size(); i += words[i] >> 16) {
            const std::uint32_t op = words[i] & 0xFFFF;
            if (op == 43) constants[words[i + 2]] = words[i + 3];
            std::vector<std::uint32_t> semantics;
            if (op == 225) semantics = {words[i + 2]};
            if (op == 224 || op == 228) semantics = {words[i + 3]};
            if (op == 227 || (op >= 229 && op <= 242)) semantics = {words[i + 5]};
            if (op == 230 || op == 231) semantics.push_back(words[i + 6]);
            for (const std::uint32_t id : semantics) {
                EXPECT_LT(id, words[3]);
                if (!constants.contains(id)) continue;  // OpConstantNull: relaxed
                if ((constants[id] & 0x1E) == 0) continue;
                EXPECT_EQ(constants[id] & 0x300, 0x300u) << name << ", word " << i;
                ++ordering;
            }
        }
    }
    EXPECT_GT(ordering, 100u);
}
#endif

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
