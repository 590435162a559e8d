// raydix render: one view of a scene as a picture.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/scene_info.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "option_checks.h"
#include "output.h"
#include "picture_options.h"
#include "scene_file.h"
#include "scene_trace.h"
#include "tree_view.h"

namespace raydix::cli {
namespace {

struct RenderCommand : PictureOptions {
    CommonOptions common;
    TreeOptions tree;
    std::string scene;
    TreeViewOptions tree_view;
};

void require_triangles(const Model& model, const std::string& scene) {
    const auto has_triangles = [](const Mesh& mesh) { return !mesh.triangles.empty(); };
    const auto has_vertices = [](const Mesh& mesh) { return !mesh.vertices.empty(); };
    if (std::ranges::none_of(model.meshes, has_triangles) &&
        std::ranges::any_of(model.meshes, has_vertices))
        throw InputError(scene +
                         ": it holds points, and this view needs triangles; --view tree and --view "
                         "slice show the tree of points");
}

/// Without a binary tree, unless the options ask for one.
SceneTree load_shown(const RenderCommand& options, std::optional<Scene>& scene, Json& about_it) {
    if (is_scene_file(options.scene)) {
        RdxScene file = load_scene_file(options.scene, options.tree, options.common);
        about_it = scene_file_json(file);
        Model model = model_of(file);
        scene.emplace(std::move(file.scene));
        return {std::move(model), {}};
    }
    if (is_rdx(options.scene) || !serves_a_scene(options.tree, options.common)) {
        SceneTree tree = load_scene_tree(options.scene, options.tree, options.common);
        require_triangles(tree.scene, options.scene);
        return tree;
    }
    Model model = load_structured_model(options.scene, options.tree, options.common);
    require_triangles(model, options.scene);
    about(options.scene,
          [&] { scene.emplace(model, scene_options(options.tree, options.common)); });
    return {std::move(model), {}};
}

/// What the rays went through, or which boxes are drawn. `quality`: of a scene, else null.
void add_trees(Json& rendered, const RenderCommand& options, const Json& quality, const Bvh& bvh) {
    const bool of_tree = is_tree_view(options.view), slice = options.view == "slice";
    const std::string& cameras = options.tree.cameras_file;
    rendered["cameras"] = cameras.empty() ? Json(nullptr) : Json(cameras);
    rendered["threads"] = threads_at_work(options.common.threads);
    rendered["tree"] = options.tree.tree;
    rendered["quality"] = quality;
    const bool of_bvh = quality.is_null() && options.tree.tree == "bvh";
    rendered["builder"] = of_bvh ? Json(builder_name(bvh.options().builder)) : Json(nullptr);
    const std::string& levels = options.tree_view.levels;
    rendered["levels"] = of_tree && !levels.empty() ? Json(levels) : Json(nullptr);
    rendered["axis"] = slice ? Json(options.tree_view.axis) : Json(nullptr);
    rendered["at"] = slice ? Json(options.tree_view.at) : Json(nullptr);
}

void run_render(RenderCommand options) {
    refuse_build_options(options.scene, options.tree);
    refuse_device(options.tree);
    const bool of_tree = is_tree_view(options.view);
    if (of_tree && is_scene_file(options.scene))
        throw CLI::ValidationError(
            "--view", options.view + " shows one tree; " + options.scene + " holds a scene");
    if (!of_tree) refuse_tree_view_options(options.tree_view);
    std::optional<Scene> scene;
    Json about_scene;  // of a file that holds one
    const TreeScene tree_scene =
        of_tree ? load_tree_scene(options.scene, options.view, options.tree_view, options.tree,
                                  options.common)
                : TreeScene{load_shown(options, scene, about_scene), {}};
    const SceneTree& input = tree_scene.input;
    const CameraSet& cameras = input.scene.cameras;
    Camera camera;
    if (options.view != "slice")
        camera = options.chosen_camera(input.scene);
    else if (!cameras.cameras.empty())
        camera = cameras.cameras.front();
    RenderOptions render_options = options.render_options(cameras, options.common);
    render_options.view = of_tree ? View::shaded : view_from_name(options.view);
    const Size size{render_options.width, render_options.height};
    const auto start = std::chrono::steady_clock::now();
    const Picture picture = about(options.scene, [&] {
        Progress progress("rendering", options.common);
        render_options.progress = [&](double part) { progress.show(part); };
        if (options.view == "slice") return draw_slice(tree_scene, options.tree_view, size);
        if (of_tree) return render_tree(input.bvh, camera, tree_scene.boxes, render_options);
        return scene ? render(*scene, camera, render_options)
                     : render(input.bvh, camera, render_options);
    });
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    const View view = render_options.view;
    save_picture(options.out_file, picture, !of_tree && is_tone_mapped(view));
    if (of_tree && options.common.prints_tables()) print_levels(tree_scene);
    if (options.common.prints_tables())
        fmt::print("{} ({} x {}, {}, {:.0f} ms)\n", options.out_file, size.width, size.height,
                   options.view, ms);
    Json document = new_document("render");
    document["scene"] = about_scene.is_null() ? scene_json(input.scene) : about_scene;
    tell_left_out(document, scene ? left_out_triangles(*scene) : input.bvh.left_out(),
                  options.common);
    document["load_ms"] = input.scene.load_ms;
    document["render"] =
        picture_json(options, camera, render_options, scene ? scene->bounds() : input.bvh.bounds());
    if (of_tree) document["render"]["samples"] = 0;
    if (options.view == "slice")
        for (const char* field : {"camera", "eye", "target", "up", "fov"})
            document["render"][field] = nullptr;
    const Json quality =
        !scene ? Json(nullptr)
        : !about_scene.is_null()
            ? about_scene["quality"]
            : Json(quality_name(scene_options(options.tree, options.common).quality));
    add_trees(document["render"], options, quality, input.bvh);
    document["render"]["ms"] = ms;
    write_json(document, options.common);
}

}  // namespace

void add_render_command(CLI::App& app) {
    auto options = std::make_shared<RenderCommand>();
    CLI::App* command = app.add_subcommand("render", "Render a view of a scene as PNG or EXR");
    command
        ->add_option("SCENE", options->scene, "A file, builtin:NAME?key=value&..., or a .rdx file")
        ->required();
    add_picture_options(*command, *options,
                        {"shaded", "ao", "diffuse", "path", "normal", "depth", "primitive", "steps",
                         "tree", "slice"});
    add_tree_view_options(*command, options->tree_view);
    add_tree_options(*command, options->tree);
    offer_binary_layout(*command);
    add_flatten_option(*command, options->common);
    add_common_options(*command, options->common);
    command->callback([options] {
        options->refuse_views();
        require_writable(options->out_file);
        require_writable_json(options->common);
        run_render(*options);
    });
}

}  // namespace raydix::cli
