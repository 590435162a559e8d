// What files hold -> scenes.
#include <algorithm>
#include <memory>
#include <utility>

#include "batch.h"
#include "scene_trees.h"

namespace raydix::python {

std::shared_ptr<SceneTrees> SceneFiles::scene_of(Model model, const BuildOptions& trees,
                                                 const SceneOptions& commits) {
    auto scene = std::make_shared<SceneTrees>(trees, commits);
    if (model.nodes.empty()) {
        if (model.meshes.empty()) model.meshes.emplace_back();
        for (Mesh& mesh : model.meshes) {
            const SceneTrees::Arrays arrays{
                std::make_shared<const SceneTrees::Vertices>(std::move(mesh.vertices)),
                std::make_shared<const SceneTrees::Arrays::Triangles>(std::move(mesh.triangles))};
            static_cast<void>(scene->add(arrays, {}));
        }
        scene->kept_ = scene->keep();
        scene->unsettled_ = true;
    } else {
        for (const Mesh& mesh : model.meshes) scene->check_strict("mesh " + mesh.name, mesh);
        SceneOptions options = commits;
        options.threads = threads_for(options.threads);
        scene->scene_ = Scene(model, options);
        // Its geometries are the nodes that stand in the world.
        for (const std::uint32_t id : scene->scene_.ids())
            scene->geometries_[id] = {.is_instance = true};
        scene->ids_given_ = scene->geometries_.size();
    }
    scene->look_for_mesh();
    return scene;
}

template <class Names>
std::shared_ptr<BasicSceneTrees<Names>> SceneFiles::scene_of_rdx(typename Names::Rdx file,
                                                                 const BuildOptions& trees) {
    auto scene = std::make_shared<BasicSceneTrees<Names>>(trees, file.options);
    scene->scene_ = std::move(file.scene);
    for (const std::uint32_t id : scene->scene_.ids()) {
        const bool is_mesh = scene->scene_.mesh(id).has_value();
        const bool is_shapes = std::ranges::binary_search(file.shape_ids, id);
        scene->geometries_[id] = {.is_instance = !is_mesh && !is_shapes,
                                  .is_shapes = is_shapes,
                                  .mask = scene->scene_.mask(id),
                                  .is_in_file = is_mesh};
        if (is_mesh)
            scene->geometries_[id].attributes =
                std::make_shared<Attributes<typename Names::Scalar>>();
    }
    scene->kept_ = scene->keep();
    scene->ids_given_ = scene->geometries_.size() + 1;
    scene->look_for_mesh();
    return scene;
}

template std::shared_ptr<SceneTrees> SceneFiles::scene_of_rdx<InFloat>(RdxScene,
                                                                       const BuildOptions&);
template std::shared_ptr<SceneTreesD> SceneFiles::scene_of_rdx<InDouble>(RdxSceneD,
                                                                         const BuildOptions&);

}  // namespace raydix::python
