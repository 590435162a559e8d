// Scenes placed many times, and rays through them.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/variant.h>
#include <raydix/error.h>
#include <raydix/instances.h>
#include <raydix/instances_d.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"
#include "ray_parts.h"
#include "scene_trees.h"

namespace raydix::python {
namespace {

using Ids = In<std::uint32_t, nb::ndim<1>>;
using FlagsOut = Out<bool, nb::ndim<1>>;

/// What scenes have, and the library's names of placed things in float32.
struct PlacedInFloat : InFloat {
    using Trees = SceneTrees;
    using Scene = InstancedScene;
    using Transform = raydix::Transform;
    using Instance = raydix::Instance;
};

/// The same in double.
struct PlacedInDouble : InDouble {
    using Trees = SceneTreesD;
    using Scene = InstancedSceneD;
    using Transform = TransformD;
    using Instance = InstanceD;
};

template <class Names>
using TransformRows = In<typename Names::Scalar, nb::shape<-1, 12>>;

/// What rays find, as one row of an array.
template <class Hit>
struct PlacedHit {
    Hit hit;
    std::uint32_t object, instance;
};
template <class Names>
using HitOf = std::conditional_t<std::is_same_v<typename Names::Scalar, float>, TreeHit, TreeHitD>;
static_assert(sizeof(PlacedHit<TreeHit>) == 6 * sizeof(float));
static_assert(sizeof(PlacedHit<TreeHitD>) == 5 * sizeof(double));

/// The objects' trees must outlive this: the binding keeps them.
template <class Names>
class PlacedScenes {
public:
    using Types = Names;
    using Trees = typename Names::Trees;
    using Scene = typename Names::Scene;
    using Transform = typename Names::Transform;

    PlacedScenes(std::vector<Trees*> scenes, std::span<const Transform> transforms,
                 std::span<const std::uint32_t> objects, std::span<const std::uint32_t> masks,
                 int threads)
        : scenes_(std::move(scenes)), threads_(threads) {
        distinct_ = scenes_;
        std::sort(distinct_.begin(), distinct_.end(), std::less<>());
        distinct_.erase(std::unique(distinct_.begin(), distinct_.end()), distinct_.end());
        const auto locks = hold();
        for (Trees* scene : scenes_) ids_.push_back(placed_.add_object(scene->bvh()));
        for (std::size_t i = 0; i < transforms.size(); ++i)
            placed_.add_instance(Scene::scene, {ids_[objects[i]], transforms[i], masks[i]});
        build();
    }

    void move(std::span<const Transform> transforms, int threads) {
        const std::unique_lock lock(use_);
        const auto locks = hold();
        threads_ = threads;
        std::vector<Transform> before;
        for (std::uint32_t i = 0; i < transforms.size(); ++i)
            before.push_back(placed_.instance(Scene::scene, i).transform);
        try {
            place(transforms);
        } catch (const InputError&) {
            place(before);
            throw;
        }
    }

    [[nodiscard]] std::uint32_t size() const { return placed_.instance_count(); }
    /// An object's number among the scenes. Objects were added one after the other.
    [[nodiscard]] std::uint32_t scene_of(std::uint32_t object) const {
        return object == no_primitive ? no_primitive : object - ids_.front();
    }

    /// Calls ask(scene, begin, end) for pieces of n rays; the objects stay as they are meanwhile.
    template <class Ask>
    void read_in_pieces(std::size_t n, const Ask& ask) {
        std::shared_lock<std::shared_mutex> lock(use_, std::defer_lock);
        std::vector<Reading> locks;
        in_pieces(n, [&](std::size_t begin, std::size_t end) {
            if (!lock.owns_lock()) {
                lock.lock();
                locks = hold();
                rebuild_if_moved();
            }
            ask(std::as_const(placed_), begin, end);
        });
    }

private:
    [[nodiscard]] std::vector<Reading> hold() const {
        std::vector<Reading> locks;
        for (Trees* scene : distinct_) locks.push_back(scene->read());
        return locks;
    }
    void place(std::span<const Transform> transforms) {
        for (std::uint32_t i = 0; i < transforms.size(); ++i) {
            typename Names::Instance instance = placed_.instance(Scene::scene, i);
            instance.transform = transforms[i];
            placed_.set_instance(Scene::scene, i, instance);
        }
        build();
    }
    void build() {
        versions_.clear();
        for (Trees* scene : scenes_) {
            static_cast<void>(scene->bvh());  // a refit that failed may have taken it
            versions_.push_back(scene->version());
        }
        placed_.build(threads_for(threads_));
    }
    /// A refit moved an object's boxes, which the tree over the places stands on.
    void rebuild_if_moved() {
        const std::lock_guard lock(rebuild_);
        for (std::size_t i = 0; i < scenes_.size(); ++i)
            if (scenes_[i]->version() != versions_[i]) return build();
    }

    std::vector<Trees*> scenes_, distinct_;
    std::vector<std::uint32_t> ids_;
    std::vector<std::uint64_t> versions_;
    Scene placed_;
    std::shared_mutex use_;
    std::mutex rebuild_;
    int threads_;
};

template <class Names>
void make(PlacedScenes<Names>* self, const nb::tuple& scenes,
          const TransformRows<Names>& transforms, const Ids& objects, const Ids& masks,
          int threads) {
    using Transform = typename Names::Transform;
    static_assert(sizeof(Transform) == 12 * sizeof(typename Names::Scalar));
    std::vector<typename Names::Trees*> trees;
    for (nb::handle scene : scenes) trees.push_back(&nb::cast<typename Names::Trees&>(scene));
    const auto placed = rows<Transform>(transforms);
    const std::span which(objects.data(), objects.shape(0)), mask(masks.data(), masks.shape(0));
    if (which.size() != placed.size() || mask.size() != placed.size())
        throw nb::value_error("objects, masks and transforms differ in length");
    for (const std::uint32_t object : which)
        if (object >= trees.size()) throw nb::value_error("objects: no such scene");
    const nb::gil_scoped_release unlocked;
    new (self) PlacedScenes<Names>(std::move(trees), placed, which, mask, threads);
}

template <class Names>
void move(PlacedScenes<Names>& self, const TransformRows<Names>& transforms, int threads) {
    const auto placed = rows<typename Names::Transform>(transforms);
    if (placed.size() != self.size())
        throw nb::value_error("transforms: another number than there are places");
    const nb::gil_scoped_release unlocked;
    self.move(placed, threads);
}

template <class Names, class Rays>
Array2<typename Names::Scalar> intersect(PlacedScenes<Names>& self, Rays& rays, std::uint32_t mask,
                                         int threads) {
    Buffer<PlacedHit<HitOf<Names>>> hits(rays.size());
    const InstanceTraceOptions options{.mask = mask, .threads = threads_for(threads)};
    self.read_in_pieces(rays.size(), [&](const auto& scene, std::size_t begin, std::size_t end) {
        const auto found = trace(scene, rays.piece(begin, end), options);
        for (std::size_t i = 0; i < found.size(); ++i)
            hits[begin + i] = {found[i].hit, self.scene_of(found[i].object), found[i].path[0]};
    });
    return hand_over_rows<typename Names::Scalar>(std::move(hits));
}

template <class Names, class Rays>
void occluded(PlacedScenes<Names>& self, Rays& rays, const FlagsOut& out, std::uint32_t mask,
              int threads) {
    const std::span flags(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    if (flags.size() != rays.size())
        throw nb::value_error("a result has another length than its queries");
    const InstanceTraceOptions options{.mask = mask, .threads = threads_for(threads)};
    self.read_in_pieces(rays.size(), [&](const auto& scene, std::size_t begin, std::size_t end) {
        trace_any(scene, rays.piece(begin, end), flags.subspan(begin, end - begin), options);
    });
}

template <class Names>
void bind_as(nb::module_& module, const char* name, const char* text) {
    using Placed = PlacedScenes<Names>;
    using Ray = typename Names::Ray;
    nb::class_<Placed> placed(module, name, text);
    placed
        .def("__init__", &make<Names>, nb::keep_alive<1, 2>(), nb::arg("scenes"),
             nb::arg("transforms").noconvert(), nb::arg("objects").noconvert(),
             nb::arg("masks").noconvert(), nb::arg("threads"))
        .def("move", &move<Names>, nb::arg("transforms").noconvert(), nb::arg("threads"))
        .def("__len__", &Placed::size);
    def_for_rays<Ray>(
        placed, "intersect",
        [](Placed& self, auto& rays, std::uint32_t mask, int threads) {
            return intersect(self, rays, mask, threads);
        },
        MoreArguments<std::uint32_t, int>(), nb::arg("mask"), nb::arg("threads"));
    def_for_rays<Ray>(
        placed, "occluded",
        [](Placed& self, auto& rays, const FlagsOut& flags, std::uint32_t mask, int threads) {
            occluded(self, rays, flags, mask, threads);
        },
        MoreArguments<const FlagsOut&, std::uint32_t, int>(), nb::arg("flags").noconvert(),
        nb::arg("mask"), nb::arg("threads"));
}

}  // namespace

void bind_instances(nb::module_& module) {
    bind_as<PlacedInFloat>(module, "Instances", "Placed scenes; raydix.Instances is what to use.");
    bind_as<PlacedInDouble>(module, "InstancesD",
                            "Placed scenes in double; raydix.Instances is what to use.");
}

}  // namespace raydix::python
