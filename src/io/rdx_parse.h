// The bytes of an .rdx file -> scene and tree, or a Scene, wherever the bytes come from.
#pragma once

#include <raydix/rdx.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace raydix::rdx {

/// `bytes` begin at a multiple of 64 and stay as they are while `owner` lives; the tree views them.
/// Memory in proportion to `bytes`, time too. Throws InputError("FILE: SECTION: reason") with
/// `file` as FILE.
[[nodiscard]] RdxFile parse(const std::string& file, std::span<const std::byte> bytes,
                            const std::shared_ptr<void>& owner);

/// The same for files of scenes (versions 2 and 3).
[[nodiscard]] RdxScene parse_scene(const std::string& file, std::span<const std::byte> bytes,
                                   const std::shared_ptr<void>& owner);

/// Of version 4.
[[nodiscard]] RdxSceneD parse_scene_double(const std::string& file,
                                           std::span<const std::byte> bytes,
                                           const std::shared_ptr<void>& owner);

}  // namespace raydix::rdx
