// Rays on devices. On an NVIDIA GPU arrays that lie there go in and come out as they are (DLPack).
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <raydix/cwbvh.h>
#include <raydix/device.h>
#include <raydix/device_cwbvh.h>
#include <raydix/device_scene.h>
#include <raydix/error.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"
#include "scene_trees.h"

namespace raydix::python {
namespace {

using DeviceRays = nb::ndarray<const float, nb::shape<-1, 8>, nb::c_contig, nb::device::cuda>;
template <class T>
using DeviceArray = nb::ndarray<T, nb::ndim<1>, nb::device::cuda>;
/// t, prim, u, v, geometry, instance
using DeviceHits =
    std::tuple<DeviceArray<float>, DeviceArray<std::uint32_t>, DeviceArray<float>,
               DeviceArray<float>, DeviceArray<std::uint32_t>, DeviceArray<std::uint32_t>>;
using FlagsOut = Out<bool, nb::ndim<1>>;

/// Hits in device memory, before and after they are named.
struct HitsThere {
    DeviceBuffer<TreeHit> found;
    DeviceBuffer<Hit> hits;

    explicit HitsThere(std::size_t count) : found(count), hits(count) {}
};

/// A compressed wide tree in device memory over all meshes of the scene. It stays as it is when the
/// scene is refitted.
class DeviceScene {
public:
    /// `device`: as select_device takes it.
    DeviceScene(SceneTrees& scene, std::string device) : device_(std::move(device)) {
        const auto lock = scene.read();
        // The binary tree of one mesh is the scene's own. Rays see it unless its mask is 0.
        const bool one = scene.is_mesh() && scene.mesh_mask() != 0;
        MergedMeshes merged;
        if (one)
            merged.names = {{0}, {*scene.mesh_id()}};
        else
            merged = merge_meshes(scene.traced());
        select();  // before more work: says why there is no device
        BuildOptions options = scene.options();
        options.threads = threads_for(options.threads);
        tree_ = DeviceCwbvh(one ? Cwbvh(scene.bvh("device"), options.threads)
                                : Cwbvh(build_bvh(merged.mesh, options), options.threads));
        names_ = DeviceMeshNames(merged.names);
        gpu_ = OnDeviceOf(tree_.tree().nodes).index();
    }

    /// Of CUDA: the one that was current when the tree was made. -1 for other kinds of devices.
    [[nodiscard]] int gpu() const { return gpu_; }
    /// In device memory; null if there is nothing to hit.
    [[nodiscard]] const void* memory() const { return tree_.tree().nodes; }

    /// What this thread does on devices from now on is done on the one of this scene: first in all
    /// calls below.
    void select() const { select_device(device_); }

    /// Nothing is waited for.
    void trace(const Ray* rays, std::size_t count, const HitsThere& out, Stream stream) const {
        trace_on_device(tree_.tree(), rays, checked(count), out.found.data(), CwbvhKernel::cwbvh,
                        {}, stream);
        name_hits_on_device(names_, {out.found.data(), count}, {out.hits.data(), count}, stream);
    }
    void trace_any(const Ray* rays, std::size_t count, std::uint8_t* occluded,
                   Stream stream) const {
        trace_any_on_device(tree_.tree(), rays, checked(count), occluded, CwbvhKernel::cwbvh, {},
                            stream);
    }

private:
    static std::uint32_t checked(std::size_t count) {
        if (count > 0xFFFFFFFFu) throw nb::value_error("more than 2^32 - 1 rays in one call");
        return static_cast<std::uint32_t>(count);
    }

    std::string device_;
    DeviceCwbvh tree_;
    DeviceMeshNames names_;
    int gpu_ = -1;
};

const Ray* aligned_rays(const DeviceRays& rays) {
    if (reinterpret_cast<std::uintptr_t>(rays.data()) % 16 != 0)
        throw nb::value_error("rays: on a device they must be aligned to 16 bytes");
    return reinterpret_cast<const Ray*>(rays.data());
}

Stream stream_of(std::uintptr_t handle) { return reinterpret_cast<Stream>(handle); }

/// Rays on the device -> the columns of their hits there, views of one array; nothing is waited
/// for, so that the hits before they were named are kept with it.
DeviceHits intersect_there(const DeviceScene& self, const DeviceRays& rays, std::uintptr_t stream) {
    const std::size_t count = rays.shape(0);
    self.select();
    const OnDeviceOf on(rays.data());  // results lie where the rays do
    auto hits = std::make_unique<HitsThere>(count);
    self.trace(aligned_rays(rays), count, *hits, stream_of(stream));
    float* const floats = reinterpret_cast<float*>(hits->hits.data());
    const nb::capsule owner = owner_of(std::move(hits));
    const int device = rays.device_id();
    const auto column = [&]<class T>(T* data) {
        return DeviceArray<T>(data, {count}, owner, {6}, nb::dtype<T>(), nb::device::cuda::value,
                              device);
    };
    const auto ids = [&](int k) { return column(reinterpret_cast<std::uint32_t*>(floats + k)); };
    return {column(floats), ids(1), column(floats + 2), column(floats + 3), ids(4), ids(5)};
}

DeviceArray<std::uint8_t> occluded_there(const DeviceScene& self, const DeviceRays& rays,
                                         std::uintptr_t stream) {
    const std::size_t count = rays.shape(0);
    self.select();
    const OnDeviceOf on(rays.data());  // results lie where the rays do
    auto flags = std::make_unique<DeviceBuffer<std::uint8_t>>(count);
    self.trace_any(aligned_rays(rays), count, flags->data(), stream_of(stream));
    std::uint8_t* const data = flags->data();
    return DeviceArray<std::uint8_t>(data, {count}, owner_of(std::move(flags)), {1},
                                     nb::dtype<std::uint8_t>(), nb::device::cuda::value,
                                     rays.device_id());
}

void intersect_here(const DeviceScene& self, const RaysIn& rays, const HitsOut& out) {
    const auto given = rows<Ray>(rays);
    const auto results = rows_out<Hit>(out);
    if (results.size() != given.size())
        throw nb::value_error("a result has another length than its queries");
    const auto ask = [&](std::size_t begin, std::size_t end) {
        self.select();
        const OnDeviceOf on(self.memory());
        const DeviceBuffer<Ray> there(given.subspan(begin, end - begin));
        const HitsThere hits(end - begin);
        self.trace(there.data(), end - begin, hits, nullptr);
        hits.hits.download(results.subspan(begin, end - begin));
    };
    in_pieces(given.size(), ask, piece_size);  // transfers of few rays take longer than the rays
}

void occluded_here(const DeviceScene& self, const RaysIn& rays, const FlagsOut& out) {
    const auto given = rows<Ray>(rays);
    const std::span results(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    if (results.size() != given.size())
        throw nb::value_error("a result has another length than its queries");
    const auto ask = [&](std::size_t begin, std::size_t end) {
        self.select();
        const OnDeviceOf on(self.memory());
        const DeviceBuffer<Ray> there(given.subspan(begin, end - begin));
        const DeviceBuffer<std::uint8_t> flags(end - begin);
        self.trace_any(there.data(), end - begin, flags.data(), nullptr);
        flags.download(results.subspan(begin, end - begin));
    };
    in_pieces(given.size(), ask, piece_size);  // transfers of few rays take longer than the rays
}

/// (how Scene(device=...) names it, the driver's name, why it cannot be used or "") of each.
std::vector<std::tuple<std::string, std::string, std::string>> known_devices() {
    std::vector<std::tuple<std::string, std::string, std::string>> all;
    for (const DeviceDescription& device : list_devices())
        all.emplace_back(device.selector, device.name, device.missing);
    return all;
}

}  // namespace

void bind_device(nb::module_& module) {
    module.def("devices", &known_devices, nb::call_guard<nb::gil_scoped_release>(),
               "(selector, name, why it cannot be used or '') of each.");
    nb::class_<DeviceScene>(module, "DeviceScene",
                            "A tree on a device; raydix.Scene(device=...) is what to use.")
        .def(nb::init<SceneTrees&, std::string>(), nb::arg("scene"), nb::arg("device"),
             nb::call_guard<nb::gil_scoped_release>())
        .def_prop_ro("gpu", &DeviceScene::gpu)
        .def("intersect_there", &intersect_there, nb::arg("rays").noconvert(), nb::arg("stream"))
        .def("occluded_there", &occluded_there, nb::arg("rays").noconvert(), nb::arg("stream"))
        .def("intersect_here", &intersect_here, nb::arg("rays").noconvert(),
             nb::arg("hits").noconvert())
        .def("occluded_here", &occluded_here, nb::arg("rays").noconvert(),
             nb::arg("flags").noconvert());
}

}  // namespace raydix::python
