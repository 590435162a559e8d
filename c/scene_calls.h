// Calls of scenes and rays, once for float and double.
#pragma once

#include <raydix/rdx.h>

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "inside.h"

namespace raydix_c {

/// The types of the C interface that belong to a number type.
template <class Scalar>
struct CTypes;
template <>
struct CTypes<float> {
    using Scene = raydix_scene;
    using Ray = raydix_ray;
    using Hit = raydix_hit;
    using HitLists = raydix_hit_lists;
    using TraceOptions = raydix_trace_options;
    using UserTest = raydix_user_test;
    static constexpr TraceOptions trace_defaults = RAYDIX_TRACE_OPTIONS;
};
template <>
struct CTypes<double> {
    using Scene = raydix_scene_d;
    using Ray = raydix_ray_d;
    using Hit = raydix_hit_d;
    using HitLists = raydix_hit_lists_d;
    using TraceOptions = raydix_trace_options_d;
    using UserTest = raydix_user_test_d;
    static constexpr TraceOptions trace_defaults = RAYDIX_TRACE_OPTIONS_D;
};

template <class Scalar>
struct SceneCalls {
    using C = CTypes<Scalar>;
    using Handle = typename C::Scene;
    using CRay = typename C::Ray;
    using CHit = typename C::Hit;
    using COptions = typename C::TraceOptions;
    using Scene = raydix::BasicScene<Scalar>;
    using Options = raydix::BasicSceneTraceOptions<Scalar>;
    using Point = raydix::BasicVec3<Scalar>;
    using Ray = raydix::BasicRay<Scalar>;
    using Hit = raydix::BasicHit<Scalar>;
    using Sphere = raydix::BasicSphere<Scalar>;
    using Capsule = raydix::BasicCapsule<Scalar>;
    static_assert(sizeof(CRay) == sizeof(Ray) && sizeof(CHit) == sizeof(Hit));
    static_assert(offsetof(CHit, u) == 2 * sizeof(Scalar) &&
                  offsetof(CHit, v) == 3 * sizeof(Scalar));
    static_assert(offsetof(CHit, geometry) == sizeof(raydix::BasicTreeHit<Scalar>));

    static raydix::SceneOptions scene_options(const raydix_commit_options* given) {
        const raydix_commit_options options = options_over(given, RAYDIX_COMMIT_OPTIONS);
        raydix::SceneOptions result;
        result.quality = static_cast<raydix::Quality>(options.quality);
        result.usage = options.moving != 0 ? raydix::Usage::moving : raydix::Usage::fixed;
        result.compact = options.compact != 0;
        result.strict = options.strict != 0;
        result.threads = options.threads;
        return result;
    }
    static raydix::BasicMeshView<Scalar> mesh_view(const Scalar* vertices, std::size_t vertex_count,
                                                   const std::uint32_t* triangles,
                                                   std::size_t triangle_count) {
        return {array_of<Point>(vertices, vertex_count, "vertices"),
                array_of<raydix::Triangle>(triangles, triangle_count, "triangles")};
    }
    static raydix::BasicTransform<Scalar> transform_of(const Scalar* numbers) {
        require(numbers, "transform");
        raydix::BasicTransform<Scalar> transform;
        for (std::size_t i = 0; i < 12; ++i) transform.m[i / 4][i % 4] = numbers[i];
        return transform;
    }

    static constexpr bool in_double = std::is_same_v<Scalar, double>;

    /// Whether a name ends in .rdx, in letters of either case.
    static bool is_rdx(std::string_view name) {
        constexpr std::string_view ending = ".rdx";
        const auto same = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a + 32 : a) == b; };
        return name.size() >= ending.size() &&
               std::ranges::equal(name.substr(name.size() - ending.size()), ending, same);
    }
    static Scene load_scene(const std::string& name, const raydix::SceneOptions& options) {
        if (!is_rdx(name)) return Scene(raydix::load_model(name), options);
        if (!raydix::holds_scene(name)) return Scene(raydix::load_rdx(name).scene, options);
        if (raydix::holds_scene_double(name) != in_double)
            throw raydix::InputError(
                name + (in_double ? ": holds a scene in float, which raydix_scene_load reads"
                                  : ": holds a scene in double, which raydix_scene_load_d reads"));
        if constexpr (in_double)
            return raydix::load_rdx_scene_double(name).scene;
        else
            return raydix::load_rdx_scene(name).scene;
    }

    static raydix_status create(Handle** scene) {
        return guarded([&] {
            require(scene, "scene");
            *scene = new Handle{};
        });
    }
    static raydix_status load(const char* path, const raydix_commit_options* options,
                              Handle** scene) {
        return guarded([&] {
            require(path, "path");
            require(scene, "scene");
            *scene = new Handle{load_scene(path, scene_options(options))};
        });
    }
    static raydix_status save(const Handle* scene, const char* path) {
        return guarded([&] {
            require(scene, "scene");
            require(path, "path");
            if (!is_rdx(path))
                throw raydix::InputError(std::string(path) +
                                         ": the name of a scene's file must end in .rdx");
            raydix::save_rdx(path, scene->scene);
        });
    }

    /// Adds a geometry and says which id it has.
    static raydix_status add(Handle* scene, std::uint32_t mask, std::uint32_t* id,
                             const auto& make) {
        return guarded([&] {
            require(scene, "scene");
            const std::uint32_t given = make(raydix::GeometryOptions{.mask = mask});
            if (id != nullptr) *id = given;
        });
    }
    static raydix_status add_mesh(Handle* scene, const Scalar* vertices, std::size_t vertex_count,
                                  const std::uint32_t* triangles, std::size_t triangle_count,
                                  std::uint32_t mask, std::uint32_t* id) {
        return add(scene, mask, id, [&](const raydix::GeometryOptions& options) {
            return scene->scene.add(mesh_view(vertices, vertex_count, triangles, triangle_count),
                                    options);
        });
    }
    /// Spheres or capsules.
    template <class Shape>
    static raydix_status add_shapes(Handle* scene, const Scalar* shapes, std::size_t count,
                                    const char* name, std::uint32_t mask, std::uint32_t* id) {
        return add(scene, mask, id, [&](const raydix::GeometryOptions& options) {
            return scene->scene.add(array_of<Shape>(shapes, count, name), options);
        });
    }
    static raydix_status add_points(Handle* scene, const Scalar* points, std::size_t count,
                                    Scalar radius, std::uint32_t mask, std::uint32_t* id) {
        return add(scene, mask, id, [&](const raydix::GeometryOptions& options) {
            return scene->scene.add(array_of<Point>(points, count, "points"), radius, options);
        });
    }
    static raydix_status add_instance(Handle* scene, const Handle* child, const Scalar* transform,
                                      std::uint32_t mask, std::uint32_t* id) {
        return add(scene, mask, id, [&](const raydix::GeometryOptions& options) {
            require(child, "child");
            return scene->scene.add(child->scene, transform_of(transform), options);
        });
    }
    static raydix_status add_user(Handle* scene, const Scalar* boxes, std::size_t count,
                                  typename C::UserTest test, void* user, std::uint32_t mask,
                                  std::uint32_t* id) {
        return add(scene, mask, id, [&](const raydix::GeometryOptions& options) {
            if (test == nullptr) throw raydix::InputError("test is NULL");
            const auto intersect = [test, user](std::uint32_t prim, const Ray& ray, Hit& hit) {
                return test(user, prim, reinterpret_cast<const CRay*>(&ray),
                            reinterpret_cast<CHit*>(&hit)) != 0;
            };
            return scene->scene.add(
                raydix::BasicUserGeometry<Scalar>(
                    array_of<raydix::BasicAabb<Scalar>>(boxes, count, "boxes"), intersect),
                options);
        });
    }
    /// Runs a call that changes a scene.
    static raydix_status change(Handle* scene, const auto& body) {
        return guarded([&] {
            require(scene, "scene");
            body(scene->scene);
        });
    }

    static raydix_status update_mesh(Handle* scene, std::uint32_t id, const Scalar* vertices,
                                     std::size_t vertex_count, const std::uint32_t* triangles,
                                     std::size_t triangle_count) {
        return change(scene, [&](Scene& changed) {
            changed.update(id, mesh_view(vertices, vertex_count, triangles, triangle_count));
        });
    }
    template <class Shape>
    static raydix_status update_shapes(Handle* scene, std::uint32_t id, const Scalar* shapes,
                                       std::size_t count, const char* name) {
        return change(scene, [&](Scene& changed) {
            changed.update(id, array_of<Shape>(shapes, count, name));
        });
    }
    static raydix_status update_points(Handle* scene, std::uint32_t id, const Scalar* points,
                                       std::size_t count, Scalar radius) {
        return change(scene, [&](Scene& changed) {
            changed.update(id, array_of<Point>(points, count, "points"), radius);
        });
    }
    static raydix_status set_transform(Handle* scene, std::uint32_t id, const Scalar* transform) {
        return change(scene,
                      [&](Scene& changed) { changed.set_transform(id, transform_of(transform)); });
    }
    static raydix_status set_mask(Handle* scene, std::uint32_t id, std::uint32_t mask) {
        return change(scene, [&](Scene& changed) { changed.set_mask(id, mask); });
    }
    static raydix_status remove(Handle* scene, std::uint32_t id) {
        return change(scene, [&](Scene& changed) { changed.remove(id); });
    }
    static raydix_status commit(Handle* scene, const raydix_commit_options* options) {
        return change(scene, [&](Scene& changed) { changed.commit(scene_options(options)); });
    }

    static raydix_status bounds(const Handle* scene, Scalar* lo, Scalar* hi) {
        return guarded([&] {
            require(scene, "scene");
            require(lo, "lo");
            require(hi, "hi");
            const raydix::BasicAabb<Scalar> box = scene->scene.bounds();
            std::copy_n(&box.lo.x, 3, lo);
            std::copy_n(&box.hi.x, 3, hi);
        });
    }
    static raydix_status size(const Handle* scene, std::uint32_t* count) {
        return guarded([&] {
            require(scene, "scene");
            require(count, "size");
            *count = scene->scene.size();
        });
    }
    static raydix_status path(const Handle* scene, std::uint32_t instance, std::uint32_t* ids,
                              std::size_t capacity, std::size_t* count) {
        return guarded([&] {
            require(scene, "scene");
            require(count, "count");
            const auto room = results_at<std::uint32_t>(ids, capacity, "ids");
            const std::vector<std::uint32_t> path = scene->scene.path(instance);
            std::copy_n(path.begin(), std::min(path.size(), room.size()), room.begin());
            *count = path.size();
        });
    }

    static Options trace_options(const COptions* given, std::size_t rays) {
        const COptions options = options_over(given, C::trace_defaults);
        Options result;
        result.mask = options.mask;
        result.threads = options.threads;
        result.max_result_bytes = options.max_result_bytes;
        if (options.masks != nullptr) result.masks = {options.masks, rays};
        if (options.filter != nullptr) {
            result.filter = [accepts = options.filter, user = options.user](
                                std::size_t place, const Ray& ray, const Hit& hit) {
                return accepts(user, place, reinterpret_cast<const CRay*>(&ray),
                               reinterpret_cast<const CHit*>(&hit)) != 0;
            };
        }
        return result;
    }
    /// Whether the call is one ray that needs no thread but this one. A number of threads out of
    /// range goes to the call for many rays, which refuses it.
    static bool is_single(std::size_t count, const Options& options) {
        return count == 1 && options.masks.empty() && options.threads >= 0 &&
               options.threads <= 1024;
    }

    static raydix_status closest(const Handle* scene, const CRay* rays, std::size_t count,
                                 CHit* hits, const COptions* options) {
        return guarded([&] {
            require(scene, "scene");
            const auto asked = array_of<Ray>(rays, count, "rays");
            const auto found = results_at<Hit>(hits, count, "hits");
            const Options how = trace_options(options, count);
            if (!is_single(count, how))
                raydix::trace(scene->scene, asked, found, how);
            else if (how.filter)
                found[0] = raydix::closest_hit(scene->scene, asked[0], how.filter, how.mask);
            else
                found[0] = raydix::closest_hit(scene->scene, asked[0], how.mask);
        });
    }
    static raydix_status any(const Handle* scene, const CRay* rays, std::size_t count,
                             std::uint8_t* occluded, const COptions* options) {
        return guarded([&] {
            require(scene, "scene");
            const auto asked = array_of<Ray>(rays, count, "rays");
            const auto found = results_at<std::uint8_t>(occluded, count, "occluded");
            const Options how = trace_options(options, count);
            if (!is_single(count, how))
                raydix::trace_any(scene->scene, asked, found, how);
            else if (how.filter)
                found[0] = raydix::any_hit(scene->scene, asked[0], how.filter, how.mask);
            else
                found[0] = raydix::any_hit(scene->scene, asked[0], how.mask);
        });
    }
    static raydix_status all(const Handle* scene, const CRay* rays, std::size_t count,
                             typename C::HitLists** lists, const COptions* options) {
        return guarded([&] {
            require(scene, "scene");
            require(lists, "lists");
            const auto asked = array_of<Ray>(rays, count, "rays");
            *lists = new typename C::HitLists{
                raydix::trace_all(scene->scene, asked, trace_options(options, count))};
        });
    }
    static raydix_status arrays(const typename C::HitLists* lists, std::size_t* rays,
                                const std::uint64_t** offsets, const CHit** hits) {
        return guarded([&] {
            require(lists, "lists");
            if (rays != nullptr) *rays = lists->lists.offsets.size() - 1;
            if (offsets != nullptr) *offsets = lists->lists.offsets.data();
            if (hits != nullptr) *hits = reinterpret_cast<const CHit*>(lists->lists.hits.data());
        });
    }
    static raydix_status positions(const Handle* scene, const CRay* rays, const CHit* hits,
                                   std::size_t count, Scalar* points, int threads) {
        return guarded([&] {
            require(scene, "scene");
            raydix::positions(scene->scene, array_of<Ray>(rays, count, "rays"),
                              array_of<Hit>(hits, count, "hits"),
                              results_at<Point>(points, count, "positions"), threads);
        });
    }
    static raydix_status normals(const Handle* scene, const CRay* rays, const CHit* hits,
                                 std::size_t count, Scalar* normals, int threads) {
        return guarded([&] {
            require(scene, "scene");
            raydix::normals(scene->scene, array_of<Ray>(rays, count, "rays"),
                            array_of<Hit>(hits, count, "hits"),
                            results_at<Point>(normals, count, "normals"), threads);
        });
    }
};

}  // namespace raydix_c
