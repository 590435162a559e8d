// raydix report: JSON documents of the other commands -> one HTML page.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/picture.h>
#include <raydix/report.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "option_checks.h"
#include "output.h"
#include "program.h"

namespace raydix::cli {
namespace {

struct ReportCommand {
    CommonOptions common;
    std::vector<std::string> results, pictures;
    std::string out_file, title, scene_folder, size_text = "480x360";
    bool render = false;
};

std::string read_text(const std::string& file) {
    std::error_code error;
    if (std::filesystem::is_directory(file, error)) throw InputError(file + ": is a folder");
    errno = 0;
    std::ifstream in(file, std::ios::binary);
    std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    if (!in) throw InputError(file + ": cannot be read: " + std::strerror(errno ? errno : EIO));
    return text;
}

/// Documents name a file by its name alone: it is looked for in the folder given.
std::string scene_spec(const std::string& name, const std::string& folder) {
    if (name.starts_with("builtin:") || folder.empty()) return name;
    return (std::filesystem::path(folder) / name).string();
}

/// Two views of a scene, or a line why there are none.
void render_views(const std::string& name, const ReportCommand& options, Size size,
                  ReportInput& input) {
    const std::string spec = scene_spec(name, options.scene_folder);
    try {
        const Model scene = load_flat_model(spec, options.common.seed);
        require_cameras(scene);
        BuildOptions build;
        build.builder = Builder::ploc;
        build.threads = options.common.threads;
        const Bvh bvh = build_bvh(scene.mesh(), build);
        RenderOptions render_options;
        render_options.width = size.width;
        render_options.height = size.height;
        render_options.threads = options.common.threads;
        render_options.seed = options.common.seed;
        const Camera& camera = scene.cameras.cameras.at(0);
        render_options.view = View::shaded;
        input.pictures.push_back(
            make_report_picture(name, "shaded", render(bvh, camera, render_options), true));
        render_options.view = View::steps;
        input.pictures.push_back(make_report_picture(
            name,
            "steps: node visits of a primary ray, from dark (few) to pale (many), in a tree of "
            "ploc; the palest is what one pixel in 200 exceeds",
            render(bvh, camera, render_options), false));
    } catch (const InputError& error) {
        if (!options.common.quiet) complain(std::string("no picture: ") + error.what());
    }
}

/// Pictures that `render` wrote, where they still are: as named, or beside the document.
void add_named_picture(const std::string& name, const std::string& document, ReportInput& input) {
    if (!name.ends_with(".png")) return;
    const std::filesystem::path beside =
        std::filesystem::path(document).parent_path() / std::filesystem::path(name).filename();
    for (const std::filesystem::path& file : {std::filesystem::path(name), beside}) {
        std::error_code error;
        if (!std::filesystem::is_regular_file(file, error)) continue;
        input.pictures.push_back(load_report_picture(file));
        return;
    }
}

void run_report(const ReportCommand& options) {
    const Size size = parse_size(options.size_text);
    ReportInput input;
    if (!options.title.empty()) input.title = options.title;
    std::vector<std::string> scenes;
    for (const std::string& file : options.results) {
        input.documents.push_back(
            {std::filesystem::path(file).filename().string(), read_text(file)});
        const ReportReferences references = report_references(input.documents.back());
        for (const std::string& scene : references.scenes)
            if (std::ranges::find(scenes, scene) == scenes.end()) scenes.push_back(scene);
        for (const std::string& picture : references.pictures)
            add_named_picture(picture, file, input);
    }
    for (const std::string& file : options.pictures)
        input.pictures.push_back(load_report_picture(file));
    if (options.render)
        for (const std::string& scene : scenes) render_views(scene, options, size, input);
    const std::string html = make_report(input);
    save_report(options.out_file, html);
    if (options.common.prints_tables())
        fmt::print("{} ({}, {}, {} kB)\n", options.out_file,
                   counted(input.documents.size(), "document", "documents"),
                   counted(input.pictures.size(), "picture", "pictures"),
                   grouped((html.size() + 999) / 1000));
}

void require_page_name(const std::string& file) {
    const std::string ending =
        CLI::detail::to_lower(std::filesystem::path(file).extension().string());
    if (!ending.empty() && ending != ".html" && ending != ".htm")
        throw CLI::ValidationError("--output", "'" + file + "' is no name of a page: .html");
}

}  // namespace

void add_report_command(CLI::App& app) {
    auto options = std::make_shared<ReportCommand>();
    CLI::App* command = app.add_subcommand(
        "report", "One self-contained HTML page from JSON documents of the other commands");
    command
        ->add_option("RESULT", options->results,
                     "Documents written with --json; two of one command are compared")
        ->required();
    command->add_option("-o,--output", options->out_file, "Page to write")
        ->check(file_name())
        ->required()
        ->type_name("FILE.html");
    command->add_option("--title", options->title, "Head of the page");
    command->add_option("--picture", options->pictures, "A picture to put in; may be repeated")
        ->type_name("FILE.png")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->add_flag("--render", options->render,
                      "Also render the scenes that the documents name: shaded, and node visits");
    command
        ->add_option("--scenes", options->scene_folder,
                     "Where scene files that the documents name lie (default: here)")
        ->type_name("FOLDER");
    add_size_option(*command, options->size_text, "Pixels of rendered pictures")
        ->capture_default_str();
    command->add_option("--threads", options->common.threads, "Threads to use (0: all)")
        ->transform(whole_number(0, 1024));
    command->add_flag("--quiet", options->common.quiet, "Print nothing");
    command->add_option("--seed", options->common.seed, "Seed of built-in scenes")
        ->transform(whole_number(0))
        ->capture_default_str();
    command->callback([options] {
        require_page_name(options->out_file);
        require_writable(options->out_file);
        run_report(*options);
    });
}

}  // namespace raydix::cli
