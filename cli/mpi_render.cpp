// raydix mpi render: a picture by all ranks, of a scene that each of them holds or that is spread
// over them.
#include <fmt/format.h>
#include <raydix/picture.h>
#include <raydix/rdx.h>
#include <raydix/scene_info.h>

#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "mpi_commands.h"
#include "mpi_input.h"
#include "mpi_ranks.h"
#include "option_checks.h"
#include "picture_options.h"
#include "scene_file.h"

namespace raydix::cli {
namespace {

struct MpiRenderCommand : MpiOptions {
    PictureOptions picture;
    bool is_distributed = false;
};

/// What all ranks must know to render.
struct Shot {
    Camera camera;
    RenderOptions options;
};

Shot shot_of(const MpiRenderCommand& command, const Model& model) {
    Shot shot{command.picture.chosen_camera(model),
              command.picture.render_options(model.cameras, command.common)};
    shot.options.view = view_from_name(command.picture.view);
    return shot;
}

/// Collective: that of rank 0, which has the model.
Shot shot_of_first(const MpiRenderCommand& command, const Model& model) {
    struct Plain {
        Vec3 position, target, up;
        float vfov, ao_radius;
        std::uint32_t width, height;
    } plain{};
    Shot shot;
    on_first([&] {
        shot = shot_of(command, model);
        plain = {shot.camera.position,   shot.camera.target, shot.camera.up,     shot.camera.vfov,
                 shot.options.ao_radius, shot.options.width, shot.options.height};
    });
    MPI_Bcast(&plain, sizeof(plain), MPI_BYTE, 0, MPI_COMM_WORLD);
    if (mpi_rank() == 0) return shot;
    shot.camera = {"", plain.position, plain.target, plain.up, plain.vfov};
    shot.options = command.picture.render_options({plain.width, plain.height, plain.ao_radius, {}},
                                                  command.common);
    shot.options.view = view_from_name(command.picture.view);
    return shot;
}

/// What was rendered, and on rank 0 what it needs to do the same alone.
struct Rendered {
    Shot shot;
    Picture picture;  // of rank 0
    Json scene;       // of the document
    double load_ms = 0;
    Json holding;  // of a distributed scene
    std::uint64_t left_out = 0;
    Scene alone;  // of rank 0, if --verify asks for it
    Aabb bounds;  // of the whole, on rank 0
    double ms = 0;
};

template <class Work>
void timed(Rendered& rendered, const Work& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    rendered.ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

void show_progress(Shot& shot, Progress& progress) {
    shot.options.progress = [&progress](double part) { progress.show(part); };
}

/// What raydix render shows of one file, or the mesh of several; gives its cameras.
Model load_shown(const MpiRenderCommand& command, Rendered& rendered) {
    const bool is_one = command.more.empty();
    if (is_one && is_scene_file(command.scene)) {
        RdxScene file = load_rdx_scene(command.scene);
        rendered.alone = std::move(file.scene);
        rendered.scene = scene_file_json(file);
        return model_of(file);
    }
    const bool is_tree = is_one && is_rdx(command.scene);
    if (is_tree && command.picture.view == "steps")
        throw CLI::ValidationError("--view", "steps of the tree in " + command.scene +
                                                 " are counted by raydix render alone");
    Model model = is_tree  ? load_rdx(command.scene).scene
                  : is_one ? load_model(command.scene, command.common.seed)
                           : load_files(command);
    SceneOptions options;
    options.threads = command.common.threads;
    about(command.names(), [&] { rendered.alone = Scene(model, options); });
    rendered.scene = scene_json(model);
    return model;
}

/// Each rank reads the scene itself.
Rendered render_replicated(const MpiRenderCommand& command) {
    Rendered rendered;
    on_each([&] {
        const Model model = load_shown(command, rendered);
        rendered.load_ms = model.load_ms;
        rendered.left_out = left_out_triangles(rendered.alone);
        rendered.shot = shot_of(command, model);
    });
    rendered.bounds = rendered.alone.bounds();
    Progress progress("rendering", command.common);
    show_progress(rendered.shot, progress);
    timed(rendered, [&] {
        rendered.picture = mpi::render(MPI_COMM_WORLD, rendered.alone, rendered.shot.camera,
                                       rendered.shot.options);
    });
    return rendered;
}

Rendered render_distributed(const MpiRenderCommand& command) {
    Rendered rendered;
    SpreadModel model = spread_model(command);
    require_triangles(model, command, "pictures");
    read_whole(model, command);  // its cameras
    rendered.shot = shot_of_first(command, model.whole);
    const MeshView view(model.part);
    const mpi::DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1), command.scene_options());
    rendered.scene = model.json(command);
    rendered.load_ms = model.load_ms;
    rendered.holding = holding_json(scene.holding());
    rendered.left_out = scene.holding().left_out;
    Progress progress("rendering", command.common);
    show_progress(rendered.shot, progress);
    timed(rendered, [&] {
        rendered.picture = mpi::render(scene, rendered.shot.camera, rendered.shot.options);
    });
    on_first([&] {
        rendered.bounds = inspect(model.whole.mesh()).bounds;
        if (command.verify) rendered.alone = Scene(model.whole.mesh());
    });
    return rendered;
}

bool same_picture(const Picture& a, const Picture& b) {
    return a.width == b.width && a.height == b.height && a.pixels.size() == b.pixels.size() &&
           std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Vec3)) == 0;
}

void run_render(const MpiRenderCommand& command) {
    Rendered rendered =
        command.is_distributed ? render_distributed(command) : render_replicated(command);
    Json document = mpi_document("mpi render", command, rendered.scene, rendered.load_ms);
    on_first([&] {
        const RenderOptions& options = rendered.shot.options;
        if (command.verify) {
            RenderOptions silent = options;
            silent.progress = {};
            const Picture alone = render(rendered.alone, rendered.shot.camera, silent);
            require_verified(same_picture(alone, rendered.picture), "pixels",
                             command.common.prints_tables());
        }
        save_picture(command.picture.out_file, rendered.picture, is_tone_mapped(options.view));
        const char* held = command.is_distributed ? "distributed" : "replicated";
        if (command.common.prints_tables())
            fmt::print("{} ({} x {}, {}, {} ranks, scene {}, {:.0f} ms)\n",
                       command.picture.out_file, options.width, options.height,
                       command.picture.view, mpi_ranks(), held, rendered.ms);
        tell_left_out(document, rendered.left_out, command.common);
        if (command.is_distributed)
            document["holding"] = rendered.holding;
        else
            document.erase("partition");
        document["render"] =
            picture_json(command.picture, rendered.shot.camera, options, rendered.bounds);
        document["render"].update({{"scene", held}, {"ms", rendered.ms}});
        document["verified"] = command.verify;
        write_json(document, command.common);
    });
}

}  // namespace

void add_mpi_render(CLI::App& app) {
    CLI::App* command = app.add_subcommand(
        "render", "Render a view of a scene: the bytes of raydix render, by all ranks");
    auto options = std::make_shared<MpiRenderCommand>();
    add_mpi_options(*command, *options);
    add_picture_options(
        *command, options->picture,
        {"shaded", "ao", "diffuse", "path", "normal", "depth", "primitive", "steps"});
    command->add_flag("--distributed", options->is_distributed,
                      "Spread the scene over the ranks. Without it each rank reads and holds all");
    command->callback([options, command] {
        options->picture.refuse_views();
        on_first([&] { require_writable(options->picture.out_file); });
        require_writable_results(*command, options->common, "", "");
        run_render(*options);
    });
}

}  // namespace raydix::cli
