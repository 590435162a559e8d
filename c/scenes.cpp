// Scenes of the C interface: geometries, commits, rays.
#include <algorithm>
#include <memory>
#include <string>

#include "inside.h"

using raydix_c::array_of;
using raydix_c::guarded;
using raydix_c::options_over;
using raydix_c::require;
using raydix_c::results_at;

static_assert(sizeof(raydix_ray) == sizeof(raydix::Ray));
static_assert(sizeof(raydix_hit) == sizeof(raydix::Hit));
static_assert(offsetof(raydix_hit, geometry) == 16 && offsetof(raydix_hit, v) == 12);

namespace {

raydix::SceneOptions scene_options(const raydix_commit_options* given) {
    const raydix_commit_options options = options_over(given, RAYDIX_COMMIT_OPTIONS);
    raydix::SceneOptions result;
    result.quality = static_cast<raydix::Quality>(options.quality);
    result.usage = options.moving != 0 ? raydix::Usage::moving : raydix::Usage::fixed;
    result.compact = options.compact != 0;
    result.strict = options.strict != 0;
    result.threads = options.threads;
    return result;
}

raydix::MeshView mesh_view(const float* vertices, std::size_t vertex_count,
                           const std::uint32_t* triangles, std::size_t triangle_count) {
    return {array_of<raydix::Vec3>(vertices, vertex_count, "vertices"),
            array_of<raydix::Triangle>(triangles, triangle_count, "triangles")};
}

raydix::Transform transform_of(const float* numbers) {
    require(numbers, "transform");
    raydix::Transform transform;
    for (std::size_t i = 0; i < 12; ++i) transform.m[i / 4][i % 4] = numbers[i];
    return transform;
}

raydix::SceneTraceOptions trace_options(const raydix_trace_options* given, std::size_t rays) {
    const raydix_trace_options options = options_over(given, RAYDIX_TRACE_OPTIONS);
    raydix::SceneTraceOptions result;
    result.mask = options.mask;
    result.threads = options.threads;
    if (options.masks != nullptr) result.masks = {options.masks, rays};
    return result;
}

/// Whether the call is one ray that needs no thread but this one.
bool is_single(std::size_t count, const raydix::SceneTraceOptions& options) {
    return count == 1 && options.masks.empty();
}

/// Adds a geometry and says which id it has.
raydix_status added(raydix_scene* scene, std::uint32_t mask, std::uint32_t* id, const auto& make) {
    return guarded([&] {
        require(scene, "scene");
        const std::uint32_t given = make(raydix::GeometryOptions{.mask = mask});
        if (id != nullptr) *id = given;
    });
}

}  // namespace

extern "C" {

raydix_status raydix_scene_create(raydix_scene** scene) {
    return guarded([&] {
        require(scene, "scene");
        *scene = new raydix_scene{};
    });
}

raydix_status raydix_scene_load(const char* path, const raydix_commit_options* options,
                                raydix_scene** scene) {
    return guarded([&] {
        require(path, "path");
        require(scene, "scene");
        const raydix::SceneOptions asked = scene_options(options);
        const std::string name = path;
        const bool saved = name.ends_with(".rdx") && raydix::holds_scene(name);
        *scene = saved ? new raydix_scene{raydix::load_rdx_scene(name).scene}
                       : new raydix_scene{raydix::Scene(raydix::load_model(name), asked)};
    });
}

void raydix_scene_destroy(raydix_scene* scene) { delete scene; }

raydix_status raydix_scene_add_mesh(raydix_scene* scene, const float* vertices, size_t vertex_count,
                                    const uint32_t* triangles, size_t triangle_count, uint32_t mask,
                                    uint32_t* id) {
    return added(scene, mask, id, [&](const raydix::GeometryOptions& options) {
        return scene->scene.add(mesh_view(vertices, vertex_count, triangles, triangle_count),
                                options);
    });
}

raydix_status raydix_scene_add_spheres(raydix_scene* scene, const float* spheres, size_t count,
                                       uint32_t mask, uint32_t* id) {
    return added(scene, mask, id, [&](const raydix::GeometryOptions& options) {
        return scene->scene.add(array_of<raydix::Sphere>(spheres, count, "spheres"), options);
    });
}

raydix_status raydix_scene_add_capsules(raydix_scene* scene, const float* capsules, size_t count,
                                        uint32_t mask, uint32_t* id) {
    return added(scene, mask, id, [&](const raydix::GeometryOptions& options) {
        return scene->scene.add(array_of<raydix::Capsule>(capsules, count, "capsules"), options);
    });
}

raydix_status raydix_scene_add_instance(raydix_scene* scene, const raydix_scene* child,
                                        const float* transform, uint32_t mask, uint32_t* id) {
    return added(scene, mask, id, [&](const raydix::GeometryOptions& options) {
        require(child, "child");
        return scene->scene.add(child->scene, transform_of(transform), options);
    });
}

raydix_status raydix_scene_update_mesh(raydix_scene* scene, uint32_t id, const float* vertices,
                                       size_t vertex_count, const uint32_t* triangles,
                                       size_t triangle_count) {
    return guarded([&] {
        require(scene, "scene");
        scene->scene.update(id, mesh_view(vertices, vertex_count, triangles, triangle_count));
    });
}

raydix_status raydix_scene_set_transform(raydix_scene* scene, uint32_t id, const float* transform) {
    return guarded([&] {
        require(scene, "scene");
        scene->scene.set_transform(id, transform_of(transform));
    });
}

raydix_status raydix_scene_set_mask(raydix_scene* scene, uint32_t id, uint32_t mask) {
    return guarded([&] {
        require(scene, "scene");
        scene->scene.set_mask(id, mask);
    });
}

raydix_status raydix_scene_remove(raydix_scene* scene, uint32_t id) {
    return guarded([&] {
        require(scene, "scene");
        scene->scene.remove(id);
    });
}

raydix_status raydix_scene_commit(raydix_scene* scene, const raydix_commit_options* options) {
    return guarded([&] {
        require(scene, "scene");
        scene->scene.commit(scene_options(options));
    });
}

raydix_status raydix_scene_size(const raydix_scene* scene, uint32_t* size) {
    return guarded([&] {
        require(scene, "scene");
        require(size, "size");
        *size = scene->scene.size();
    });
}

raydix_status raydix_scene_bounds(const raydix_scene* scene, float* lo, float* hi) {
    return guarded([&] {
        require(scene, "scene");
        require(lo, "lo");
        require(hi, "hi");
        const raydix::Aabb box = scene->scene.bounds();
        std::copy_n(&box.lo.x, 3, lo);
        std::copy_n(&box.hi.x, 3, hi);
    });
}

raydix_status raydix_scene_path(const raydix_scene* scene, uint32_t instance, uint32_t* ids,
                                size_t capacity, size_t* count) {
    return guarded([&] {
        require(scene, "scene");
        require(count, "count");
        const auto room = results_at<std::uint32_t>(ids, capacity, "ids");
        const std::vector<std::uint32_t> path = scene->scene.path(instance);
        std::copy_n(path.begin(), std::min(path.size(), room.size()), room.begin());
        *count = path.size();
    });
}

raydix_status raydix_trace_closest(const raydix_scene* scene, const raydix_ray* rays, size_t count,
                                   raydix_hit* hits, const raydix_trace_options* options) {
    return guarded([&] {
        require(scene, "scene");
        const auto asked = array_of<raydix::Ray>(rays, count, "rays");
        const auto found = results_at<raydix::Hit>(hits, count, "hits");
        const raydix::SceneTraceOptions how = trace_options(options, count);
        if (is_single(count, how))
            found[0] = raydix::closest_hit(scene->scene, asked[0], how.mask);
        else
            raydix::trace(scene->scene, asked, found, how);
    });
}

raydix_status raydix_trace_any(const raydix_scene* scene, const raydix_ray* rays, size_t count,
                               uint8_t* occluded, const raydix_trace_options* options) {
    return guarded([&] {
        require(scene, "scene");
        const auto asked = array_of<raydix::Ray>(rays, count, "rays");
        const auto found = results_at<std::uint8_t>(occluded, count, "occluded");
        const raydix::SceneTraceOptions how = trace_options(options, count);
        if (is_single(count, how))
            found[0] = raydix::any_hit(scene->scene, asked[0], how.mask);
        else
            raydix::trace_any(scene->scene, asked, found, how);
    });
}

raydix_status raydix_hit_normals(const raydix_scene* scene, const raydix_ray* rays,
                                 const raydix_hit* hits, size_t count, float* normals,
                                 int threads) {
    return guarded([&] {
        require(scene, "scene");
        raydix::normals(scene->scene, array_of<raydix::Ray>(rays, count, "rays"),
                        array_of<raydix::Hit>(hits, count, "hits"),
                        results_at<raydix::Vec3>(normals, count, "normals"), threads);
    });
}

}  // extern "C"
