// .rdx files that hold a scene: built and written, read, described.
#pragma once

#include <raydix/rdx_scene.h>

#include <string>

#include "options.h"
#include "output.h"

namespace raydix::cli {

[[nodiscard]] const char* quality_name(Quality quality);
[[nodiscard]] const char* layout_name(const SceneOptions& options);

/// Whether `build -o` writes a scene: the user chose its layout, or the model has several meshes or
/// nodes and no option asks for one binary tree.
[[nodiscard]] bool wants_scene_layout(const TreeOptions& tree);
[[nodiscard]] bool saves_a_scene(const Model& model, const TreeOptions& tree,
                                 const CommonOptions& common);

/// Commits `model` as a scene, once and then `repeat` times on the clock, and writes it.
void build_scene_file(Model model, const std::string& scene, const std::string& file, int repeat,
                      const TreeOptions& tree, const CommonOptions& common);

/// Options that ask for anything else than the scene as it is are usage errors.
[[nodiscard]] RdxScene load_scene_file(const std::string& file, const TreeOptions& tree,
                                       const CommonOptions& common);

/// What other commands take of it: name, cameras and the time of loading, without a mesh.
[[nodiscard]] Model model_of(const RdxScene& file);
[[nodiscard]] Json scene_file_json(const RdxScene& file);

}  // namespace raydix::cli
