// What a launch over a compressed wide tree on a device refuses. No device is needed.
#include "gpu/device_cwbvh.h"

#include <gtest/gtest.h>

#include <string>

namespace raydix {
namespace {

/// What is wrong with the call; "" if nothing.
std::string refusal(const DeviceCwbvhTree& tree, std::uintptr_t rays, std::uintptr_t hits,
                    CwbvhKernel kernel = CwbvhKernel::cwbvh, std::span<std::byte> scratch = {}) {
    try {
        check_cwbvh_launch({tree, reinterpret_cast<const Ray*>(rays), 7,
                            reinterpret_cast<TreeHit*>(hits), nullptr, kernel, scratch, nullptr});
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(DeviceCwbvh, MemoryMustBeAligned) {
    const auto tree_at = [](std::uintptr_t nodes, std::uintptr_t triangles) {
        DeviceCwbvhTree tree;
        tree.nodes = reinterpret_cast<const CwbvhNode*>(nodes);
        tree.triangles = reinterpret_cast<const CwbvhTriangle*>(triangles);
        tree.node_count = 1;
        return tree;
    };
    EXPECT_EQ(refusal(tree_at(256, 336), 512, 1024), "");
    const std::string batch = "rays and hits on the device are not aligned to 16 bytes";
    EXPECT_EQ(refusal(tree_at(256, 336), 520, 1024), batch);
    EXPECT_EQ(refusal(tree_at(256, 336), 512, 1028), batch);
    EXPECT_EQ(refusal(tree_at(256, 336), 512, 0), "");  // any hit: bytes are written instead
    const std::string wide = "the wide tree on the device is not aligned to 16 bytes";
    EXPECT_EQ(refusal(tree_at(264, 336), 512, 1024), wide);
    EXPECT_EQ(refusal(tree_at(256, 344), 512, 1024), wide);
}

TEST(DeviceCwbvh, ScratchMustBeThere) {
    const auto scratch_at = [](std::uintptr_t place, std::size_t bytes) {
        return std::span(reinterpret_cast<std::byte*>(place), bytes);
    };
    constexpr CwbvhKernel kernel = CwbvhKernel::persistent_cwbvh;
    EXPECT_EQ(refusal({}, 512, 1024, kernel, scratch_at(256, 256)), "");
    EXPECT_NE(refusal({}, 512, 1024, kernel, scratch_at(256, 255)), "");
    EXPECT_NE(refusal({}, 512, 1024, kernel, scratch_at(128, 256)), "");
}

}  // namespace
}  // namespace raydix
