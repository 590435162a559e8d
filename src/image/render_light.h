// The views that gather light: shaded, AO, diffuse, path. Primary samples [n] -> linear colours
// [n].
#pragma once

#include <vector>

#include "image/render_scene.h"

namespace raydix {

/// Lights for a camera: "up" is taken from it, since files do not say which way their scene stands.
[[nodiscard]] Lights make_lights(const Tracer& tracer, const CameraFrame& frame, Vec3 camera_up);

/// What a ray of this unit direction sees where it hits nothing.
[[nodiscard]] Vec3 sky_colour(const Lights& lights, Vec3 direction);

/// Sun with shadow, lamp, and sky light that nearby surfaces take away from each other.
[[nodiscard]] std::vector<Vec3> shade_samples(const RenderScene& scene,
                                              const PrimarySamples& primary);

/// The open part of the hemisphere within the radius; 1 where nothing was hit.
[[nodiscard]] std::vector<Vec3> open_sky_samples(const RenderScene& scene,
                                                 const PrimarySamples& primary);

/// Sun and lamp with shadows, and one bounce: the light of the sky and of the surfaces around.
[[nodiscard]] std::vector<Vec3> diffuse_samples(const RenderScene& scene,
                                                const PrimarySamples& primary);

/// Sun and lamp with shadows at each of up to eight further surfaces, and the sky where a path
/// leaves the scene.
[[nodiscard]] std::vector<Vec3> path_samples(const RenderScene& scene,
                                             const PrimarySamples& primary);

}  // namespace raydix
