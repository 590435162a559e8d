// What commands that render share: camera, view, size, and the file.
#pragma once

#include <raydix/picture.h>

#include <optional>
#include <string>
#include <vector>

#include "output.h"

namespace raydix::cli {

struct PictureOptions {
    std::string out_file, view = "shaded", size_text;
    std::size_t camera = 0;
    std::vector<float> eye, target, up;
    std::optional<float> fov;
    int samples = 0;
    float ao_radius = 0.0f;

    /// Usage errors: --eye, --target and --up that make no view, whatever the scene is.
    void refuse_views() const;
    /// Of the scene's cameras the one that was asked for, moved as it was asked for. Throws
    /// InputError: there is no such camera, or cameras.json is at fault and --eye does not replace
    /// it.
    [[nodiscard]] Camera chosen_camera(const Model& scene) const;
    /// Whether chosen_camera() moved it.
    [[nodiscard]] bool moves_camera() const {
        return !eye.empty() || !target.empty() || !up.empty() || fov;
    }
    /// All but the view.
    [[nodiscard]] RenderOptions render_options(const CameraSet& cameras,
                                               const CommonOptions& common) const;
};
/// The start of the `render` object of a document. `bounds`: of the scene.
[[nodiscard]] Json picture_json(const PictureOptions& options, const Camera& camera,
                                const RenderOptions& chosen, const Aabb& bounds);
void add_picture_options(CLI::App& command, PictureOptions& options,
                         const std::vector<std::string>& views);

}  // namespace raydix::cli
