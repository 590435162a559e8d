// .rdx files: one tree with its geometry, and, by raydix/rdx_scene.h, whole scenes.
#pragma once

#include <raydix/bvh.h>
#include <raydix/model.h>
#include <raydix/rdx_scene.h>  // IWYU pragma: export

#include <filesystem>

namespace raydix {

/// Saves a tree with the model that it was built from (docs/rdx-format.md). Writes as write_file of
/// files.h, so that a reader never sees half a file. Throws InputError: a tree that does not belong
/// to the model, a file that cannot be written.
void save_rdx(const std::filesystem::path& file, const Bvh& bvh, const Model& scene);

struct RdxFile {
    Model scene;
    Bvh bvh;  // views the mapped file, which stays mapped as long as the tree lives
};

/// Loads a tree. Maps the file, compares lengths and checksums, then validates children, ranges,
/// acyclicity and geometry in O(n) before anything is used. The file must not be changed in place
/// while the tree lives; to replace it by renaming is safe. Throws InputError: "FILE: SECTION:
/// reason".
[[nodiscard]] RdxFile load_rdx(const std::filesystem::path& file);

}  // namespace raydix
