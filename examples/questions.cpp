// The answers of docs/questions.md as programs: each part between two marks stands there word for
// word, and what it says of the library is asked here.
#include <raydix/bvh.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <future>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

using namespace raydix;

namespace {

bool all_true = true;

void expect(bool is_true, const char* what) {
    if (!is_true) std::printf("not true: %s\n", what);
    all_true = all_true && is_true;
}

// [tools]
/// Two triangles at height z, from -1 to 1 in x and y.
Mesh square(float z) {
    return {"square", {{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}}, {{0, 1, 2}, {0, 2, 3}}};
}
/// From height 0 straight up.
Ray up(float x, float y) { return {.origin = {x, y, 0}, .direction = {0, 0, 1}}; }
// [end]

void who_owns_arrays() {
    // [owners]
    Mesh mesh = square(1), kept = square(2);
    Scene scene;
    scene.add(mesh);    // a copy: `mesh` may change or go
    scene.share(kept);  // no copy: `kept` must stay as long as the scene
    scene.commit();
    Bvh tree = build_bvh(mesh);                         // holds copies of all that rays read
    const Points points = build_points(mesh.vertices);  // so does an index of points
    const Solid solid(tree);                            // refers to `tree`, which must stay
    mesh = {};
    expect(closest_hit(scene, up(0.5f, 0.0f)).t == 1, "the scene has its own copy");
    expect(closest_hit(tree, up(0.5f, 0.0f)).t == 1, "so has the tree");
    expect(points.size() == 4, "and the index");
    expect(scene.mesh(1)->vertices.data() == kept.vertices.data(),
           "a shared array is the caller's");
    expect(solid.closure() == Closure::open, "the solid reads the tree");
    // [end]
}

void what_happens_to_nan() {
    // [nan]
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    Mesh mesh = square(1);
    mesh.vertices[3].x = nan;  // a corner of triangle 1 alone
    Scene scene;
    scene.add(mesh);
    expect(scene.commit().left_out == 1, "a commit counts what it leaves out");
    const std::vector<Ray> rays = {
        up(0.5f, 0), up(-0.5f, 0), {.origin = {nan, 0, 0}, .direction = {0, 0, 1}}};
    std::vector<Hit> hits(rays.size());
    const TraceCounts counts = trace(scene, rays, hits);
    expect(hits[0].hit() && !hits[1].hit(), "triangle 1 is left out, triangle 0 is not");
    expect(!hits[2].hit() && hits[2].t == infinity && counts.invalid_rays == 1, "a miss, counted");

    bool refused = false;
    try {
        scene.commit({.strict = true});
    } catch (const InputError&) {
        refused = true;
    }
    expect(refused, "with `strict` it is an error");

    std::vector<SceneClosestPoint> near(1);
    expect(closest_points(scene, std::vector<Vec3>{{0, nan, 0}}, near).invalid_queries == 1 &&
               !near[0].found(),
           "a query of NaN finds nothing, and is counted");
    // [end]
}

void which_calls_may_run_at_once() {
    // [at-once]
    Scene inner(square(1)), scene;
    scene.add(inner, Transform{});
    scene.commit();
    const auto look = [&scene] { return closest_hit(scene, up(0.5f, 0)).t; };
    auto one = std::async(std::launch::async, look), two = std::async(std::launch::async, look);
    inner.update(0, square(3));  // rays of `scene` meet what its last commit saw
    inner.commit();
    expect(one.get() == 1 && two.get() == 1, "any number of threads may ask one scene");
    scene.commit();  // not before the other threads are done: it needs `scene` for itself
    expect(look() == 3, "now the new square is there");
    // [end]
}

void what_happens_to_ids() {
    // [ids]
    Scene scene;
    const std::uint32_t low = scene.add(square(1)), middle = scene.add(square(2)),
                        high = scene.add(square(3));
    scene.commit();
    scene.remove(low);
    expect(closest_hit(scene, up(0.5f, 0)).geometry == low, "until the commit rays still meet it");
    scene.commit();
    expect(closest_hit(scene, up(0.5f, 0)).geometry == middle, "others keep their ids");
    expect(scene.add(square(4)) == high + 1, "an id that is free again is not given again");
    expect(!scene.contains(low) && scene.size() == 3, "it is gone");
    bool refused = false;
    try {
        scene.set_mask(low, 1);
    } catch (const InputError&) {
        refused = true;
    }
    expect(refused, "and to name it is an error");
    // [end]
}

void what_t_means_on_instances() {
    // [instances]
    const Scene inner(square(1));
    Scene scene;
    const Transform twice{{{{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 2, 0}}}};
    const std::uint32_t id = scene.add(inner, twice);  // the square stands at height 2
    scene.commit();
    Ray ray = up(0.5f, 0);
    Hit hit = closest_hit(scene, ray);
    expect(hit.t == 2, "t counts lengths of the caller's direction, in the outer scene");
    ray.direction.z = 4;
    expect(closest_hit(scene, ray).t == 0.5f, "of a longer direction there are fewer");
    expect(hit.instance == 1 && scene.path(1) == std::vector{id}, "the way to the hit");
    expect(hit.geometry == 0 && hit.prim == 0, "geometry and prim are those of the inner scene");
    const Vec3 point = positions(scene, std::vector{hit})[0];
    expect(point.x == 0.5f && point.y == 0 && point.z == 2, "points are in the outer scene");
    // [end]
}

void what_is_bit_equal() {
    // [bits]
    const Model model = load_model("builtin:figure?triangles=5000");
    const auto rays = make_primary_rays(model.cameras.cameras[0], 64, 64);
    const std::vector<Hit> expected = trace_brute_force(model.mesh(), rays);
    std::size_t differences = 0;
    const auto compare = [&](const std::vector<Hit>& hits) {
        for (std::size_t i = 0; i < hits.size(); ++i)
            differences += hits[i].t != expected[i].t || hits[i].prim != expected[i].prim ||
                           hits[i].u != expected[i].u || hits[i].v != expected[i].v;
    };
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const int threads : {1, 2}) {
            const Scene scene(model, {.quality = quality, .threads = threads});
            for (const std::string& isa : simd_instruction_sets())
                compare(trace(scene, rays, {.threads = threads, .isa = isa}));
            compare(trace(build_bvh(model.mesh(), build_options_for(quality)), rays));
        }
    expect(differences == 0, "t, prim, u and v do not depend on any of it");
    expect(tree_hash(build_bvh(square(1))) ==
               tree_hash(build_bvh(square(1), {.builder = Builder::apetrei, .threads = 1})),
           "nor does a tree on the number of threads");
    // [end]
}

void what_errors_are_thrown() {
    // [errors]
    const auto error_of = [](const auto& call) -> std::string {
        try {
            call();
        } catch (const BackendUnavailable& error) {  // no such device or feature here
            return std::string("unavailable: ") + error.what();
        } catch (const InputError& error) {  // a file, a mesh, an option
            return std::string("input: ") + error.what();
        }
        return "none";
    };
    Scene scene;
    expect(error_of([&] { static_cast<void>(closest_hit(scene, up(0, 0))); }) ==
               "input: scene: it was never committed",
           "a scene without a commit");
    expect(error_of([&] {
               scene.add(MeshView(square(1).vertices, std::vector<Triangle>{{0, 1, 4}}));
           }) == "input: geometry 0: triangle 0 has an index past the 4 vertices",
           "element and reason");
    expect(scene.size() == 0, "what throws changes nothing");
    expect(error_of([&] {
               static_cast<void>(load_model("no-such.ply"));
           }).starts_with("input: no-such.ply: "),
           "file and reason");
    // [end]
}

void how_large_results_end() {
    // [too-large]
    const Scene scene(square(1));
    const std::vector<Ray> rays(100'000, up(0.5f, 0));
    bool refused = false;
    try {
        static_cast<void>(trace_all(scene, rays, {.max_result_bytes = 100'000}));
    } catch (const ResultTooLarge& error) {  // an InputError
        refused = error.bytes() >= 100'000;
    }
    expect(refused, "the call ends before it holds more than that");
    expect(trace_all(scene, rays).hits.size() == rays.size(), "by default half of what is left");
    // [end]
}

void what_callbacks_may_do() {
    // [callbacks]
    Scene scene;
    scene.add(square(1));
    scene.add(square(2));
    scene.commit();
    std::atomic<int> calls = 0;  // called from several threads, in any order, any number of times
    const HitFilter upper = [&calls](std::size_t, const Ray&, const Hit& hit) {
        ++calls;
        return hit.geometry == 1;  // depends on the arguments alone
    };
    const std::vector<Ray> rays(1000, up(0.5f, 0));
    for (const Hit& hit : trace(scene, rays, {.filter = upper}))
        expect(hit.t == 2, "the lower square is refused");
    expect(calls >= 1000, "at least once for each hit");
    bool came_out = false;
    try {
        static_cast<void>(
            trace(scene, rays, {.filter = [](std::size_t, const Ray&, const Hit&) -> bool {
                      throw std::runtime_error("enough");
                  }}));
    } catch (const std::runtime_error&) {
        came_out = true;
    }
    expect(came_out, "what a callback throws comes out of the call");

    scene.update(0, square(5));
    try {
        scene.commit({.progress = [](double) { throw std::runtime_error("stop"); }});
    } catch (const std::runtime_error&) {
    }
    expect(closest_hit(scene, up(0.5f, 0)).t == 1, "a commit that was stopped changed nothing");
    // [end]
}

void what_changes_without_commit() {
    // [commit]
    Scene scene(square(1));
    scene.update(0, square(7));
    expect(!scene.committed(), "there is a change that no commit has seen");
    expect(closest_hit(scene, up(0.5f, 0)).t == 1,
           "rays, queries, bounds and paths are of the last commit");
    expect(scene.bounds().lo.z == 1, "also the bounds");
    expect(scene.mesh(0)->vertices[0].z == 7, "size, ids, masks and meshes are of the change");
    scene.commit();
    expect(closest_hit(scene, up(0.5f, 0)).t == 7 && scene.committed(), "now the change is there");
    // [end]
}

}  // namespace

int main() {
    who_owns_arrays();
    what_happens_to_nan();
    which_calls_may_run_at_once();
    what_happens_to_ids();
    what_t_means_on_instances();
    what_is_bit_equal();
    what_errors_are_thrown();
    how_large_results_end();
    what_callbacks_may_do();
    what_changes_without_commit();
    std::printf(all_true ? "all answers are true\n" : "some answers are not true\n");
    return all_true ? 0 : 1;
}
