// Cameras of scenes -> rays and pictures.
#include "scene_views.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <raydix/camera.h>
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/rays.h>
#include <raydix/scene.h>

#include <cstdint>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "figures.h"

namespace raydix::python {
namespace {

template <class Scene>
using Scalar = typename Scene::Types::Scalar;
template <class Scene>
using Fields = CameraFields<Scalar<Scene>>;

template <class Scene>
nb::dict fit(const Coordinates<Scalar<Scene>>& lo, const Coordinates<Scalar<Scene>>& hi,
             Scalar<Scene> vfov) {
    return camera_figures(fit_camera(typename Scene::Types::Box{point_of(lo), point_of(hi)}, vfov));
}

template <class Scene>
nb::tuple primary_rays(const Fields<Scene>& camera, std::uint32_t width, std::uint32_t height) {
    std::vector<std::uint32_t> pixels;
    std::vector<typename Scene::Types::Ray> rays;
    {
        const nb::gil_scoped_release unlocked;
        rays = make_primary_rays(camera_of(camera), width, height, &pixels);
    }
    return nb::make_tuple(hand_over_rows<Scalar<Scene>>(std::move(rays)),
                          hand_over(std::move(pixels)));
}

RayKind ray_kind(const std::string& name) {
    for (const RayKind kind : {RayKind::ao, RayKind::diffuse, RayKind::diffuse_shuffled})
        if (name == ray_kind_name(kind)) return kind;
    throw InputError("unknown kind of rays \"" + name +
                     "\"; known are ao, diffuse, diffuse_shuffled");
}

/// From what these rays hit: traced here, so that rays and hits belong together.
template <class Scene>
Array2<Scalar<Scene>> secondary_rays(Scene& scene, const In<Scalar<Scene>, nb::shape<-1, 8>>& rays,
                                     const std::string& kind, int samples, float radius,
                                     std::uint64_t seed, int threads) {
    using Ray = typename Scene::Types::Ray;
    const auto primary = raydix::python::rows<Ray>(rays);
    const SecondaryOptions options{.kind = ray_kind(kind),
                                   .samples = samples,
                                   .ao_radius = radius,
                                   .seed = seed,
                                   .threads = threads_for(threads)};
    std::vector<Ray> secondary;
    {
        const nb::gil_scoped_release unlocked;
        const auto lock = scene.read();
        const auto hits = trace(scene.traced(), primary, {.threads = threads_for(threads)});
        std::vector<std::uint32_t> pixels(primary.size());
        std::iota(pixels.begin(), pixels.end(), 0u);
        secondary = make_secondary_rays(scene.traced(), primary, hits, pixels, options);
    }
    return hand_over_rows<Scalar<Scene>>(std::move(secondary));
}

using PictureOut = nb::ndarray<nb::numpy, float, nb::ndim<3>>;

PictureOut picture_array(Picture&& picture) {
    auto kept = std::make_unique<Picture>(std::move(picture));
    float* const data = reinterpret_cast<float*>(kept->pixels.data());
    const std::size_t width = kept->width, height = kept->height;
    return PictureOut(data, {height, width, 3}, owner_of(std::move(kept)));
}

template <class Scene>
PictureOut render_scene(Scene& scene, const Fields<Scene>& camera, const std::string& view,
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

}  // namespace

template <class Scene>
void bind_views(nb::class_<Scene>& scene) {
    scene.def_static("fit_camera", &fit<Scene>, nb::arg("lo"), nb::arg("hi"), nb::arg("vfov"));
    scene.def_static("primary_rays", &primary_rays<Scene>, nb::arg("camera"), nb::arg("width"),
                     nb::arg("height"));
    scene.def("secondary_rays", &secondary_rays<Scene>, nb::arg("rays").noconvert(),
              nb::arg("kind"), nb::arg("samples"), nb::arg("radius"), nb::arg("seed"),
              nb::arg("threads"));
    scene.def("render", &render_scene<Scene>, nb::arg("camera"), nb::arg("view"), nb::arg("width"),
              nb::arg("height"), nb::arg("samples"), nb::arg("ao_radius"), nb::arg("seed"),
              nb::arg("threads"));
}

template void bind_views(nb::class_<SceneTrees>& scene);
template void bind_views(nb::class_<SceneTreesD>& scene);

}  // namespace raydix::python
