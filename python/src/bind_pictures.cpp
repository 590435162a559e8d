// Files and built-in scenes, and files of pictures.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <raydix/camera.h>
#include <raydix/model.h>
#include <raydix/picture.h>
#include <raydix/rdx_scene.h>
#include <raydix/report.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "figures.h"

namespace raydix::python {
namespace {

nb::dict load(const nb::bytes& file, std::uint64_t seed) {
    const std::string spec = path_of(file);
    Model scene;
    {
        const nb::gil_scoped_release unlocked;
        scene = load_flat_model(spec, seed);
    }
    nb::dict fields;
    fields["name"] = text_of(scene.name);
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

}  // namespace

void bind_pictures(nb::module_& module) {
    module.def("load_scene", &load, nb::arg("file"), nb::arg("seed"));
    module.def(
        "holds_scene_double",
        [](const nb::bytes& file) { return holds_scene_double(path_of(file)); }, nb::arg("file"),
        "Whether a .rdx file holds a scene in float64.");
    module.def("scenes", &scenes, "The built-in scenes and their parameters.");
    module.def(
        "save_picture",
        [](const nb::bytes& path, const PictureIn& pixels, bool tone_map) {
            const std::string file = path_of(path);
            const nb::gil_scoped_release unlocked;
            save_picture(file, picture_of(pixels), tone_map);
        },
        nb::arg("file"), nb::arg("picture").noconvert(), nb::arg("tone_map"));
    module.def("png", &png, nb::arg("picture").noconvert(), nb::arg("tone_map"));
}

}  // namespace raydix::python
