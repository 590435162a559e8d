// What several test programs need: shared scenes, seeded random numbers, files in a folder of the
// test's own.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include <raydix/mesh.h>

#include "support/temp_path.h"

namespace raydix::test {

/// A file below the shared scenes folder; `skip_without` skips the test if it is not there.
std::filesystem::path shared_scene(const std::string& name);
/// A file of the project.
std::filesystem::path source_file(const std::string& name);
/// A file of the folder that the tests are built in.
std::filesystem::path built_file(const std::string& name);

#define RAYDIX_SKIP_WITHOUT(path)       \
    if (!std::filesystem::exists(path)) \
    GTEST_SKIP() << "shared scene not present: " << (path).string()

/// A new, empty folder for one test; removed with the object.
class TempFolder : public TempPath {
public:
    TempFolder();
};

/// Fewer rays under the sanitizers and on an emulated processor, which slow everything down by an
/// order of magnitude.
#if defined(RAYDIX_SANITIZED) || defined(RAYDIX_EMULATED)
inline constexpr std::size_t thorough = 1;
#else
inline constexpr std::size_t thorough = 20;
#endif

/// All geometries of a scene.
inline constexpr std::uint32_t every_mask = 0xFFFFFFFFu;

/// `count` small triangles at random places in the unit cube.
Mesh random_soup(std::size_t count, std::uint64_t seed, float size = 0.05f);
/// With every k-th vertex NaN or infinite.
Mesh laced(Mesh mesh, std::size_t k);

}  // namespace raydix::test
