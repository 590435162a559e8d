#include "picture_options.h"

#include <raydix/error.h>
#include <raydix/rays.h>

#include <algorithm>
#include <filesystem>

#include "option_checks.h"
#include "ray_launches.h"

namespace raydix::cli {
namespace {

Vec3 vec_of(const std::vector<float>& v) { return {v[0], v[1], v[2]}; }

std::string picture_fault(const std::string& file) {
    const std::string ending = CLI::detail::to_lower(std::filesystem::path(file).extension());
    if (file.empty()) return "the name of the file is empty";
    return ending == ".png" || ending == ".exr"
               ? ""
               : file + ": unknown picture type '" + ending + "'; known: .png .exr";
}

}  // namespace

void PictureOptions::refuse_views() const {
    const bool points_nowhere = std::ranges::all_of(up, [](float x) { return x == 0; });
    if (!up.empty() && points_nowhere) throw CLI::ValidationError("--up", "0 0 0 is no direction");
    if (eye.empty() || target.empty()) return;
    if (eye == target)
        throw CLI::ValidationError("--eye", "is where --target is: there is no view");
    if (up.empty()) return;
    const Camera shown{"", vec_of(eye), vec_of(target), vec_of(up), 45.0f};
    try {
        static_cast<void>(make_primary_rays(shown, 1, 1));
    } catch (const InputError&) {
        throw CLI::ValidationError("--up", "is parallel to the view from --eye to --target");
    }
}

Camera PictureOptions::chosen_camera(const Model& scene) const {
    if (eye.empty() || camera != 0) require_cameras(scene);
    const std::vector<Camera>& cameras = scene.cameras.cameras;
    if (camera >= cameras.size())
        throw InputError(scene.name + ": camera " + std::to_string(camera) +
                         " is past the last of " + std::to_string(cameras.size()) + " cameras");
    Camera chosen = cameras[camera];
    if (!eye.empty()) chosen.position = vec_of(eye);
    if (!target.empty()) chosen.target = vec_of(target);
    if (!up.empty()) chosen.up = vec_of(up);
    if (fov) chosen.vfov = *fov;
    // Errors name the camera: those of what the options changed must not be looked for in a file.
    const std::pair<bool, const char*> changes[] = {{!eye.empty(), " --eye"},
                                                    {!target.empty(), " --target"},
                                                    {!up.empty(), " --up"},
                                                    {fov.has_value(), " --fov"}};
    if (moves_camera()) chosen.name += " with";
    for (const auto& [changed, option] : changes)
        if (changed) chosen.name += option;
    return chosen;
}

RenderOptions PictureOptions::render_options(const CameraSet& cameras,
                                             const CommonOptions& common) const {
    const Size size =
        size_text.empty() ? Size{cameras.width, cameras.height} : parse_size(size_text);
    RenderOptions chosen;
    chosen.width = size.width;
    chosen.height = size.height;
    chosen.samples = samples;
    chosen.ao_radius = ao_radius > 0 ? ao_radius : cameras.ao_radius;
    chosen.seed = common.seed;
    chosen.threads = common.threads;
    return chosen;
}

Json picture_json(const PictureOptions& options, const Camera& camera, const RenderOptions& chosen,
                  const Aabb& bounds) {
    const auto xyz = [](Vec3 v) { return Json::array({v.x, v.y, v.z}); };
    const bool is_ao = chosen.view == View::ao;
    return {{"file", options.out_file},
            {"view", options.view},
            {"width", chosen.width},
            {"height", chosen.height},
            {"camera", options.moves_camera() ? Json(nullptr) : Json(camera.name)},
            {"eye", xyz(camera.position)},
            {"target", xyz(camera.target)},
            {"up", xyz(camera.up)},
            {"fov", camera.vfov},
            {"samples", light_samples(chosen)},
            {"ao_radius",
             is_ao ? Json(chosen_ao_radius(chosen.ao_radius, {}, bounds)) : Json(nullptr)}};
}

void add_picture_options(CLI::App& command, PictureOptions& options,
                         const std::vector<std::string>& views) {
    command
        .add_option("-o,--output", options.out_file,
                    "Picture to write: .png, or .exr for linear values")
        ->check(CLI::Validator(picture_fault, ""))
        ->required()
        ->type_name("PICTURE");
    command.add_option("--view", options.view, "What to show")
        ->check(CLI::IsMember(views))
        ->capture_default_str();
    add_size_option(command, options.size_text, "Pixels (default: of cameras.json, or 1024x768)");
    command.add_option("--camera", options.camera, "Number of a camera")
        ->transform(whole_number(0))
        ->capture_default_str();
    const auto add_vector = [&](const char* name, std::vector<float>& value, const char* what) {
        command.add_option(name, value, what)
            ->expected(3)
            ->delimiter(',')
            ->allow_extra_args(false)
            ->check(any_finite_number());
    };
    add_vector("--eye", options.eye, "Camera position x y z");
    add_vector("--target", options.target, "Point looked at x y z");
    add_vector("--up", options.up, "Direction that is up in the picture x y z");
    command.add_option("--fov", options.fov, "Vertical field of view in degrees")
        ->check(number_up_to(179, false));
    command
        .add_option("--samples", options.samples,
                    "Rays per pixel of views with chance (0: the view's own default)")
        ->transform(whole_number(0, 4096))
        ->capture_default_str();
    command
        .add_option("--ao-radius", options.ao_radius,
                    "Reach of ao rays (default: of cameras.json, or 5 % of the diagonal)")
        ->check(finite_number(false));
}

}  // namespace raydix::cli
