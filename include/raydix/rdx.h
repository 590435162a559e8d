// .rdx files: a tree with its geometry.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <filesystem>

namespace raydix {

/// Versioned, little-endian, 64-byte aligned sections, a checksum (XXH3-128) per section and one
/// over the header. Writes as write_file of files.h, so that a reader never sees half a file.
/// Throws InputError.
void save_rdx(const std::filesystem::path& file, const Bvh& bvh, const Model& scene);

struct RdxFile {
    Model scene;
    Bvh bvh;  // views the mapped file, which stays mapped as long as the tree lives
};

/// Maps the file, compares lengths and checksums, then validates children, ranges, acyclicity and
/// geometry in O(n) before anything is used: a right checksum proves nothing. Throws InputError:
/// "FILE: SECTION: reason".
[[nodiscard]] RdxFile load_rdx(const std::filesystem::path& file);

}  // namespace raydix
