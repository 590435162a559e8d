// Files and built-in scenes, cameras, rays from them, pictures.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <raydix/camera.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/report.h>
#include <raydix/trace.h>

#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"
#include "figures.h"
#include "scene_trees.h"

namespace raydix::python {
namespace {

nb::dict load(const std::string& spec, std::uint64_t seed) {
    Model scene;
    {
        const nb::gil_scoped_release unlocked;
        scene = load_flat_model(spec, seed);
    }
    nb::dict fields;
    fields["name"] = scene.name;
    Mesh mesh = std::move(scene).mesh();
    fields["vertices"] = hand_over_rows<float>(std::move(mesh.vertices));
    fields["faces"] = hand_over_rows<std::uint32_t>(std::move(mesh.triangles));
    nb::list cameras;
    for (const Camera& camera : scene.cameras.cameras) cameras.append(camera_figures(camera));
    fields["cameras"] = cameras;
    fields["width"] = scene.cameras.width;
    fields["height"] = scene.cameras.height;
    fields["ao_radius"] = scene.cameras.ao_radius;
    fields["load_ms"] = scene.load_ms;
    return fields;
}

nb::list scenes() {
    nb::list all;
    for (const BuiltinScene& scene : builtin_scenes()) {
        nb::dict parameters;
        for (const BuiltinParameter& parameter : scene.parameters)
            parameters[nb::cast(std::string(parameter.name))] = parameter.default_value;
        nb::dict fields;
        fields["name"] = std::string(scene.name);
        fields["what"] = std::string(scene.what);
        fields["parameters"] = parameters;
        all.append(fields);
    }
    return all;
}

nb::tuple primary_rays(const CameraFields& camera, std::uint32_t width, std::uint32_t height) {
    std::vector<std::uint32_t> pixels;
    std::vector<Ray> rays;
    {
        const nb::gil_scoped_release unlocked;
        rays = make_primary_rays(camera_of(camera), width, height, &pixels);
    }
    return nb::make_tuple(hand_over_rows<float>(std::move(rays)), hand_over(std::move(pixels)));
}

RayKind ray_kind(const std::string& name) {
    for (const RayKind kind : {RayKind::ao, RayKind::diffuse, RayKind::diffuse_shuffled})
        if (name == ray_kind_name(kind)) return kind;
    throw InputError("unknown kind of rays \"" + name +
                     "\"; known are ao, diffuse, diffuse_shuffled");
}

/// From what these rays hit: traced here, so that rays and hits belong together.
Array2<float> secondary_rays(SceneTrees& scene, const RaysIn& rays, const std::string& kind,
                             int samples, float radius, std::uint64_t seed, int threads) {
    const auto primary = rows<Ray>(rays);
    const SecondaryOptions options{.kind = ray_kind(kind),
                                   .samples = samples,
                                   .ao_radius = radius,
                                   .seed = seed,
                                   .threads = threads_for(threads)};
    std::vector<Ray> secondary;
    {
        const nb::gil_scoped_release unlocked;
        const auto lock = scene.read();
        const std::vector<Hit> hits =
            trace(scene.traced(), primary, {.threads = threads_for(threads)});
        std::vector<std::uint32_t> pixels(primary.size());
        for (std::uint32_t i = 0; i < pixels.size(); ++i) pixels[i] = i;
        secondary = make_secondary_rays(scene.traced(), primary, hits, pixels, options);
    }
    return hand_over_rows<float>(std::move(secondary));
}

using PictureOut = nb::ndarray<nb::numpy, float, nb::ndim<3>>;

PictureOut picture_array(Picture&& picture) {
    auto kept = std::make_unique<Picture>(std::move(picture));
    float* const data = reinterpret_cast<float*>(kept->pixels.data());
    const std::size_t width = kept->width, height = kept->height;
    return PictureOut(data, {height, width, 3}, owner_of(std::move(kept)));
}

PictureOut render_scene(SceneTrees& scene, const CameraFields& camera, const std::string& view,
                        std::uint32_t width, std::uint32_t height, int samples, float ao_radius,
                        std::uint64_t seed, int threads) {
    RenderOptions options;
    options.view = view_from_name(view);
    options.width = width;
    options.height = height;
    options.samples = samples;
    options.ao_radius = ao_radius;
    options.seed = seed;
    options.threads = threads_for(threads);
    options.progress = hear_signals_on_this_thread();
    Picture picture;
    {
        const nb::gil_scoped_release unlocked;
        const auto lock = scene.read();
        picture = render(scene.traced(), camera_of(camera), options);
    }
    return picture_array(std::move(picture));
}

using PictureIn = In<float, nb::shape<-1, -1, 3>>;

Picture picture_of(const PictureIn& pixels) {
    Picture picture{.width = static_cast<std::uint32_t>(pixels.shape(1)),
                    .height = static_cast<std::uint32_t>(pixels.shape(0)),
                    .pixels = {}};
    const Vec3* const first = reinterpret_cast<const Vec3*>(pixels.data());
    picture.pixels.assign(first, first + pixels.shape(0) * pixels.shape(1));
    return picture;
}

nb::bytes png(const PictureIn& pixels, bool tone_map) {
    ReportPicture picture;
    {
        const nb::gil_scoped_release unlocked;
        picture = make_report_picture("", "", picture_of(pixels), tone_map);
    }
    return nb::bytes(picture.png.data(), picture.png.size());
}

nb::dict fit(const Coordinates& lo, const Coordinates& hi, float vfov) {
    return camera_figures(fit_camera({vec3(lo), vec3(hi)}, vfov));
}

}  // namespace

void bind_pictures(nb::module_& module) {
    module.def("load_scene", &load, nb::arg("spec"), nb::arg("seed"));
    module.def("scenes", &scenes, "The built-in scenes and their parameters.");
    module.def("primary_rays", &primary_rays, nb::arg("camera"), nb::arg("width"),
               nb::arg("height"));
    module.def("secondary_rays", &secondary_rays, nb::arg("scene"), nb::arg("rays").noconvert(),
               nb::arg("kind"), nb::arg("samples"), nb::arg("radius"), nb::arg("seed"),
               nb::arg("threads"));
    module.def("fit_camera", &fit, nb::arg("lo"), nb::arg("hi"), nb::arg("vfov"));
    module.def("render", &render_scene, nb::arg("scene"), nb::arg("camera"), nb::arg("view"),
               nb::arg("width"), nb::arg("height"), nb::arg("samples"), nb::arg("ao_radius"),
               nb::arg("seed"), nb::arg("threads"));
    module.def(
        "save_picture",
        [](const std::string& file, const PictureIn& pixels, bool tone_map) {
            save_picture(file, picture_of(pixels), tone_map);
        },
        nb::arg("file"), nb::arg("picture").noconvert(), nb::arg("tone_map"),
        nb::call_guard<nb::gil_scoped_release>());
    module.def("png", &png, nb::arg("picture").noconvert(), nb::arg("tone_map"));
}

}  // namespace raydix::python
