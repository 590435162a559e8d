// Rays on an NVIDIA GPU: arrays that lie there go in and come out as they are (DLPack).
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>
#include <raydix/cwbvh.h>
#include <raydix/device.h>
#include <raydix/device_cwbvh.h>
#include <raydix/error.h>

#include <cstdint>
#include <memory>
#include <span>
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
using DeviceHits = std::tuple<DeviceArray<float>, DeviceArray<std::uint32_t>, DeviceArray<float>,
                              DeviceArray<float>>;
using FlagsOut = Out<bool, nb::ndim<1>>;

/// A compressed wide tree in device memory, made from the scene's binary one. It stays as it is
/// when the scene is refitted.
class DeviceScene {
public:
    explicit DeviceScene(SceneTrees& scene) : tree_(copy_of(scene)) {}

    void trace(const Ray* rays, std::size_t count, TreeHit* hits, Stream stream) const {
        trace_on_device(tree_.tree(), rays, checked(count), hits, CwbvhKernel::cwbvh, {}, stream);
    }
    void trace_any(const Ray* rays, std::size_t count, std::uint8_t* occluded,
                   Stream stream) const {
        trace_any_on_device(tree_.tree(), rays, checked(count), occluded, CwbvhKernel::cwbvh, {},
                            stream);
    }

private:
    static DeviceCwbvh copy_of(SceneTrees& scene) {
        static_cast<void>(device_name());  // before any work: says why there is no device
        const auto lock = scene.read();
        if (!scene.is_mesh())
            throw BackendUnavailable(
                "device='cuda': takes scenes of one mesh, and this one has instances, several "
                "meshes or no commit");
        if (scene.mesh_id() && scene.mesh_mask() != 0xFFFFFFFFu)
            throw BackendUnavailable(
                "device='cuda': the mesh has a mask, which rays on a GPU do not know");
        return DeviceCwbvh(Cwbvh(scene.bvh("device='cuda'"), threads_for(scene.options().threads)));
    }
    static std::uint32_t checked(std::size_t count) {
        if (count > 0xFFFFFFFFu) throw nb::value_error("more than 2^32 - 1 rays in one call");
        return static_cast<std::uint32_t>(count);
    }

    DeviceCwbvh tree_;
};

const Ray* aligned_rays(const DeviceRays& rays) {
    if (reinterpret_cast<std::uintptr_t>(rays.data()) % 16 != 0)
        throw nb::value_error("rays: on a device they must be aligned to 16 bytes");
    return reinterpret_cast<const Ray*>(rays.data());
}

Stream stream_of(std::uintptr_t handle) { return reinterpret_cast<Stream>(handle); }

/// Rays on the device -> t, prim, u, v there, four views of one array; nothing is waited for.
DeviceHits intersect_there(const DeviceScene& self, const DeviceRays& rays, std::uintptr_t stream) {
    const std::size_t count = rays.shape(0);
    auto hits = std::make_unique<DeviceBuffer<TreeHit>>(count);
    self.trace(aligned_rays(rays), count, hits->data(), stream_of(stream));
    float* const floats = reinterpret_cast<float*>(hits->data());
    const nb::capsule owner = owner_of(std::move(hits));
    const int device = rays.device_id();
    const auto column = [&]<class T>(T* data) {
        return DeviceArray<T>(data, {count}, owner, {4}, nb::dtype<T>(), nb::device::cuda::value,
                              device);
    };
    return {column(floats), column(reinterpret_cast<std::uint32_t*>(floats + 1)),
            column(floats + 2), column(floats + 3)};
}

DeviceArray<std::uint8_t> occluded_there(const DeviceScene& self, const DeviceRays& rays,
                                         std::uintptr_t stream) {
    const std::size_t count = rays.shape(0);
    auto flags = std::make_unique<DeviceBuffer<std::uint8_t>>(count);
    self.trace_any(aligned_rays(rays), count, flags->data(), stream_of(stream));
    std::uint8_t* const data = flags->data();
    return DeviceArray<std::uint8_t>(data, {count}, owner_of(std::move(flags)), {1},
                                     nb::dtype<std::uint8_t>(), nb::device::cuda::value,
                                     rays.device_id());
}

void intersect_here(const DeviceScene& self, const RaysIn& rays, const HitsOut& out) {
    const auto given = rows<Ray>(rays);
    const auto results = rows_out<TreeHit>(out);
    if (results.size() != given.size())
        throw nb::value_error("a result has another length than its queries");
    in_pieces(given.size(), [&](std::size_t begin, std::size_t end) {
        const DeviceBuffer<Ray> there(given.subspan(begin, end - begin));
        const DeviceBuffer<TreeHit> hits(end - begin);
        self.trace(there.data(), end - begin, hits.data(), nullptr);
        hits.download(results.subspan(begin, end - begin));
    });
}

void occluded_here(const DeviceScene& self, const RaysIn& rays, const FlagsOut& out) {
    const auto given = rows<Ray>(rays);
    const std::span results(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    if (results.size() != given.size())
        throw nb::value_error("a result has another length than its queries");
    in_pieces(given.size(), [&](std::size_t begin, std::size_t end) {
        const DeviceBuffer<Ray> there(given.subspan(begin, end - begin));
        const DeviceBuffer<std::uint8_t> flags(end - begin);
        self.trace_any(there.data(), end - begin, flags.data(), nullptr);
        flags.download(results.subspan(begin, end - begin));
    });
}

}  // namespace

void bind_device(nb::module_& module) {
    nb::class_<DeviceScene>(module, "DeviceScene",
                            "A tree on a GPU; raydix.Scene with device='cuda' is what to use.")
        .def(nb::init<SceneTrees&>(), nb::arg("scene"), nb::call_guard<nb::gil_scoped_release>())
        .def("intersect_there", &intersect_there, nb::arg("rays").noconvert(), nb::arg("stream"))
        .def("occluded_there", &occluded_there, nb::arg("rays").noconvert(), nb::arg("stream"))
        .def("intersect_here", &intersect_here, nb::arg("rays").noconvert(),
             nb::arg("hits").noconvert())
        .def("occluded_here", &occluded_here, nb::arg("rays").noconvert(),
             nb::arg("flags").noconvert());
}

}  // namespace raydix::python
