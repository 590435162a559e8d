#include "scene_workloads.h"

#include <raydix/error.h>

#include <algorithm>

#include "base/math.h"
#include "closest_queries.h"
#include "scene_frames.h"
#include "scene_peers.h"
#include "scene_subjects.h"

namespace raydix::bench {

bool SceneBench::wants(const std::string& workload) const {
    return std::find(only.begin(), only.end(), workload) != only.end();
}

namespace {

Quality quality_of(const std::string& name) {
    return name == "fast" ? Quality::fast : name == "high" ? Quality::high : Quality::balanced;
}

bool accept_all(std::uint32_t) { return true; }
bool accept_half(std::uint32_t prim) { return prim % 2 == 0; }

/// A mesh or a cloud that was named, or a built-in mesh.
struct Input {
    std::string given;
    SharedMesh mesh;
};

class Workloads {
public:
    Workloads(const SceneBench& options, std::uint64_t seed, int threads,
              const std::function<void(const Question&)>& answered)
        : options_(options),
          seed_(seed),
          size_(cli::parse_size(options.size)),
          sides_{quality_of(options.quality), threads},
          answered_(answered) {}

    void run() {
        load();
        for (const Input& input : meshes_) cli::about(input.given, [&] { run_mesh(input); });
        plants();
        spheres();
        discs();
        fixed();
        if (options_.wants("frames"))
            for (const std::uint64_t triangles : options_.frames) frames(triangles);
    }

private:
    void load() {
        for (const std::string& name : options_.scenes) {
            const SharedMesh mesh = load_shared_mesh(name, seed_);
            if (mesh->triangles.empty() && mesh->vertices.empty())
                throw InputError(name + ": holds neither triangles nor points");
            (mesh->triangles.empty() ? clouds_ : meshes_).push_back({name, mesh});
        }
        if (!meshes_.empty()) return;
        const std::string triangles = options_.quick ? "10000" : "200000";
        for (const char* kind : {"figure", "atrium"}) {
            const std::string name = std::string("builtin:") + kind + "?triangles=" + triangles;
            meshes_.push_back({name, load_shared_mesh(name, seed_)});
        }
    }

    void run_mesh(const Input& input) {
        const Mesh& mesh = *input.mesh;
        if (options_.wants("instances"))
            instances("instances", input.mesh->name,
                      make_instances(input.mesh, options_.instances, seed_));
        if (options_.wants("nested"))
            instances("nested", input.mesh->name,
                      make_nested(input.mesh, options_.instances, seed_));
        const std::vector<RayKindOf> rays = make_rays(bounds_of(mesh), size_, seed_);
        const auto about = [&](const char* workload) {
            return Question{.workload = workload,
                            .scene = input.mesh->name,
                            .primitives = mesh.triangles.size()};
        };
        if (options_.wants("all_hits")) {
            const auto ours = our_all_hits(mesh, sides_);
            const auto peers = embree_all_hits(mesh, sides_);
            for (const RayKindOf& kind : rays)
                answered_(ask_all_hits(about("all_hits"), kind, *ours, peers, options_));
        }
        if (options_.wants("filters")) {
            filters(about("filters"), mesh, rays, " accept all", accept_all);
            filters(about("filters"), mesh, rays, " accept half", accept_half);
        }
        if (options_.wants("closest")) closest(about("closest"), mesh);
        if (options_.wants("doubles")) {
            RaySides in_float;
            in_float.push_back(as_peer(our_mesh(mesh, sides_), "raydix float"));
            const auto in_double = our_double_mesh(mesh, sides_);
            Question beside_float = about("doubles");
            beside_float.compares_times = true;
            ask_all(beside_float, rays, in_double.get(), in_float);
        }
        if (options_.wants("moved")) moved(input);
    }

    void instances(const char* workload, const std::string& name, const PlacedScene& scene) {
        const auto ours = our_instances(scene, sides_);
        const auto peers = embree_instances(scene, sides_);
        ask_all({.workload = workload, .scene = name, .primitives = leaves_of(scene).size()},
                make_rays(bounds_of(scene), size_, seed_), ours.get(), peers);
    }

    void ask_all(const Question& about, const std::vector<RayKindOf>& rays, RaySide* ours,
                 const RaySides& peers) {
        for (const RayKindOf& kind : rays)
            for (const Question& question : ask_rays(about, kind, ours, peers, options_))
                answered_(question);
    }

    void filters(const Question& about, const Mesh& mesh, const std::vector<RayKindOf>& rays,
                 const char* which, AcceptPrimitive accept) {
        const auto ours = our_filtered_mesh(mesh, accept, sides_);
        const auto peers = embree_filtered_meshes(mesh, accept, sides_);
        for (const RayKindOf& kind : rays)
            for (Question& question : ask_rays(about, kind, ours.get(), peers, options_)) {
                question.text += which;
                answered_(question);
            }
    }

    void closest(const Question& about, const Mesh& mesh) {
        const auto ours = our_closest_points(mesh, sides_);
        const auto peers = embree_closest_points(mesh, sides_);
        const Aabb box = bounds_of(mesh);
        const std::pair<const char*, std::vector<Vec3>> kinds[] = {
            {"near", near_queries(mesh, box, options_.queries, seed_)},
            {"far", queries_around(box, options_.queries, 4, seed_)}};
        for (const auto& [name, queries] : kinds) {
            Question question = about;
            question.text = name;
            answered_(ask_closest(question, queries, mesh, *ours, peers, options_));
        }
    }

    void moved(const Input& input) {
        const PlacedScene scene = make_instances(input.mesh, options_.moved, seed_);
        std::array<std::vector<Affine>, 2> places;
        for (const PlacedLeaf& leaf : leaves_of(scene)) places[0].push_back(leaf.to_world);
        for (const PlacedLeaf& leaf :
             leaves_of(make_instances(input.mesh, options_.moved, seed_ + 1'000'000)))
            places[1].push_back(leaf.to_world);
        const auto ours = our_moving_instances(scene, sides_);
        const auto peers = embree_moving_instances(scene, sides_);
        const RayKindOf random = make_rays(bounds_of(scene), size_, seed_).back();
        const Question about{
            .workload = "moved", .scene = input.mesh->name, .primitives = options_.moved};
        for (const Question& question : ask_moving(about, places, random, *ours, peers, options_))
            answered_(question);
    }

    void plants() {
        if (!options_.wants("plants")) return;
        const std::uint64_t triangles = options_.quick ? 500 : 5000;
        instances("plants", "a plant of builtin:grove",
                  make_plants(make_plant(triangles, seed_), options_.plants, seed_));
    }

    void spheres() {
        if (!options_.wants("spheres")) return;
        ask_spheres("made at random", make_spheres(options_.shapes, seed_));
        for (const Input& cloud : clouds_)
            ask_spheres(cloud.mesh->name, spheres_around(cloud.mesh->vertices));
    }
    void ask_spheres(const std::string& name, const std::vector<Sphere>& spheres) {
        const auto ours = our_spheres(spheres, sides_);
        const auto peers = embree_spheres(spheres, sides_);
        Aabb box = empty_box();
        for (const Sphere& s : spheres) box = unite(box, {s.center, s.center});
        ask_all({.workload = "spheres", .scene = name, .primitives = spheres.size()},
                make_rays(box, size_, seed_), ours.get(), peers);
    }

    void discs() {
        if (!options_.wants("user")) return;
        const std::vector<Disc> discs = make_discs(options_.shapes, seed_);
        const auto ours = our_discs(discs, sides_);
        const auto peers = embree_discs(discs, sides_);
        ask_all({.workload = "user", .scene = "discs at random", .primitives = discs.size()},
                make_rays({{0, 0, 0}, {1, 1, 1}}, size_, seed_), ours.get(), peers);
    }

    void fixed() {
        if (!options_.wants("fixed")) return;
        const std::vector<SharedMesh> pieces = make_pieces(options_.pieces, 5000, seed_);
        const SharedMesh one = merged(pieces);
        const auto ours = our_fixed_scene(pieces, sides_);
        const Question about{.workload = "fixed",
                             .scene = std::to_string(pieces.size()) + " figures",
                             .primitives = one->triangles.size()};
        RaySides peers;
        peers.push_back(as_peer(our_mesh(*one, sides_), "raydix merged"));
        ask_all(about, make_rays(bounds_of(*one), size_, seed_), ours.get(), peers);
    }

    void frames(std::uint64_t triangles) {
        const SharedMesh mesh =
            load_shared_mesh("builtin:figure?triangles=" + std::to_string(triangles), seed_);
        const auto ours = our_moving_mesh(*mesh, sides_), guide = our_moving_mesh(*mesh, sides_);
        const auto peers = embree_moving_mesh(*mesh, sides_);
        const Question about{
            .workload = "frames", .scene = mesh->name, .primitives = mesh->triangles.size()};
        const MovingPicture picture(*mesh, size_, seed_);
        for (const Question& question : ask_frames(about, picture, *ours, peers, *guide, options_))
            answered_(question);
    }

    /// One of our own sides in the place of Embree.
    class AsPeer : public RaySide {
    public:
        AsPeer(std::unique_ptr<RaySide> side, std::string name)
            : side_(std::move(side)), name_(std::move(name)) {}
        void take(std::span<const Ray> rays) override { side_->take(rays); }
        std::vector<SideMode> modes() override {
            std::vector<SideMode> modes = side_->modes();
            for (SideMode& mode : modes) {
                mode.side = name_;
                mode.ours = false;
            }
            return modes;
        }
        PlacedHit hit(std::size_t ray) const override { return side_->hit(ray); }
        bool found(std::size_t ray) const override { return side_->found(ray); }

    private:
        std::unique_ptr<RaySide> side_;
        std::string name_;
    };
    static std::unique_ptr<RaySide> as_peer(std::unique_ptr<RaySide> side, const char* name) {
        return std::make_unique<AsPeer>(std::move(side), name);
    }

    const SceneBench& options_;
    std::uint64_t seed_;
    cli::Size size_;
    SubjectOptions sides_;
    const std::function<void(const Question&)>& answered_;
    std::vector<Input> meshes_, clouds_;
};

}  // namespace

void run_workloads(const SceneBench& options, std::uint64_t seed, int threads,
                   const std::function<void(const Question&)>& answered) {
    Workloads(options, seed, threads, answered).run();
}

}  // namespace raydix::bench
