#include "cpu_study.h"

#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/machine.h>
#include <raydix/wide.h>

#include <filesystem>
#include <fstream>
#include <optional>

#include "cpu_builds.h"
#include "cpu_rates.h"
#include "cpu_report.h"
#include "embree_api.h"

namespace raydix::bench {
namespace {

using cli::Json;

/// A scene in memory, and all trees over it.
class LoadedScene {
public:
    LoadedScene(const std::string& name, const CpuBench& options, int threads)
        : model_(cli::load_model_with_cameras(name, tree_options(options), options.common)) {
        Mesh& mesh = model_.mesh();
        if (mesh.triangles.empty()) throw InputError(name + ": holds no triangles");
        mesh.vertices.reserve(mesh.vertices.size() + 1);
        names_ = peers_of(options);
        threads_ = threads;
        options_ = &options;
    }

    [[nodiscard]] const Model& model() const { return model_; }

    [[nodiscard]] WorkloadFigures measure(const Workload& workload,
                                          const std::vector<int>& thread_counts) {
        if (!rays_) prepare();
        return measure_rates(workload, *rays_, names_, peers_, *options_, thread_counts);
    }

private:
    static cli::TreeOptions tree_options(const CpuBench& options) {
        cli::TreeOptions tree;
        tree.cameras_file = options.cameras_file;
        return tree;
    }

    void prepare() {
        const Mesh& mesh = model_.mesh();
        for (const PeerName& name : names_) {
            peers_.push_back(make_peer(name, mesh, *options_, threads_));
            peers_.back()->build();
        }
        for_rays_.share(mesh);
        for_rays_.commit({.threads = threads_});
        rays_.emplace(*options_, model_, for_rays_);
    }

    Model model_;
    const CpuBench* options_;
    int threads_;
    std::vector<PeerName> names_;
    std::vector<std::unique_ptr<Peer>> peers_;
    Scene for_rays_;
    std::optional<WorkloadRays> rays_;
};

class CpuStudy {
public:
    explicit CpuStudy(const CpuBench& options)
        : options_(options),
          threads_(options.common.threads > 0 ? options.common.threads : machine_info().cores),
          thread_counts_{threads_},
          workloads_(workloads_from(options.workloads)) {
        if (options.threads_study && threads_ > 1) thread_counts_.insert(thread_counts_.begin(), 1);
        if (options.no_rays) workloads_.clear();
        static_cast<void>(peers_of(options));
    }

    void run() {
        if (options_.resume) resume();
        for (const std::string& name : options_.scenes) study(name, "tuned");
        for (const std::string& name : options_.held_out) study(name, "held_out");
        if (tables()) print_summary(summary_of(scenes_));
        write_json(document(true), options_.common);
    }

private:
    [[nodiscard]] bool tables() const { return options_.common.prints_tables(); }

    Json options_json() const {
        std::vector<std::string> names;
        for (const Workload& w : workloads_) names.push_back(w.text);
        return {{"scenes", options_.scenes},
                {"held_out", options_.held_out},
                {"cameras", options_.cameras_file},
                {"quality", options_.qualities},
                {"embree", options_.embree},
                {"isa", options_.isas},
                {"all_paths", options_.all_paths},
                {"threads", threads_},
                {"threads_study", options_.threads_study},
                {"builds", !options_.no_builds},
                {"sah", options_.sah},
                {"workloads", names},
                {"camera", options_.launches.camera},
                {"size", options_.launches.size_text},
                {"sample", options_.launches.sample},
                {"samples", options_.launches.samples},
                {"launch_rays", options_.launches.launch_rays},
                {"ao_radius", options_.launches.ao_radius},
                {"seed", options_.common.seed},
                {"rounds", options_.rounds},
                {"clock", options_.clock},
                {"tolerance", options_.tolerance},
                {"instruction_sets", simd_instruction_sets()}};
    }

    Json document(bool complete) const {
        Json document = cli::new_document("bench cpu");
        document["embree"] = embree_version();
        document["options"] = options_json();
        document["complete"] = complete;
        document["scenes"] = Json::array();
        for (const SceneFigures& figures : scenes_) {
            Json& json = document["scenes"].emplace_back(figures_json(figures));
            json["ratios"] = Json::array();
            for (const Ratio& r : ratios_of(figures)) json["ratios"].push_back(ratio_json(r));
            json["speed_ups"] = Json::array();
            for (const SpeedUp& s : speed_ups_of(figures))
                json["speed_ups"].push_back({{"peer", s.peer},
                                             {"workload", text_or_null(s.workload)},
                                             {"figure", s.figure},
                                             {"speed_up", s.value}});
        }
        document["summary"] = summary_json(summary_of(scenes_));
        return document;
    }

    static Json text_or_null(const std::string& text) {
        return text.empty() ? Json(nullptr) : Json(text);
    }
    static Json ratio_json(const Ratio& r) {
        return {{"raydix", r.ours},
                {"embree", r.embree},
                {"workload", text_or_null(r.workload)},
                {"figure", r.figure},
                {"best", text_or_null(r.best)},
                {"ratio", r.value}};
    }

    /// Takes the scenes of the document that is there, if there is one.
    void resume() {
        const std::string& file = options_.common.json_file;
        if (!std::filesystem::exists(file)) return;
        Json there;
        try {
            std::ifstream stream(file, std::ios::binary);
            there = Json::parse(stream);
            const Json here = document(false);
            for (const char* field : {"command", "machine", "embree", "options"})
                if (there.at(field) != here.at(field))
                    throw InputError(file + ": is of another " + field +
                                     ", so --resume cannot go on with it");
            for (const Json& scene : there.at("scenes")) earlier_.push_back(figures_from(scene));
        } catch (const Json::exception&) {
            throw InputError(file +
                             ": is no document of bench cpu, so --resume cannot go on with it");
        }
    }

    void save() const {
        if (options_.common.json_file != "-") write_json(document(false), options_.common);
    }

    void study(const std::string& name, const std::string& group) {
        const std::size_t place = scenes_.size();
        SceneFigures& figures = scenes_.emplace_back();
        if (place < earlier_.size()) figures = earlier_[place];
        std::optional<LoadedScene> scene;
        const auto loaded = [&]() -> LoadedScene& {
            if (!scene) scene.emplace(name, options_, threads_);
            return *scene;
        };
        if (figures.scene.empty()) {
            figures.scene = loaded().model().name;
            figures.group = group;
            figures.triangles = loaded().model().mesh().triangles.size();
            figures.threads = threads_;
        }
        if (figures.builds.empty() && !options_.no_builds) {
            figures.builds = measure_builds(name, options_, thread_counts_);
            save();
        }
        if (tables() && place == 0)
            fmt::print("Embree {}, {}; builds in processes of their own\n", embree_version(),
                       machine_info().cpu);
        if (tables()) print_scene(figures);
        if (tables() && !workloads_.empty())
            print_head_of_workloads(options_.rounds, options_.clock);
        for (const Workload& workload : workloads_) {
            if (!figures.has(workload.text)) {
                LoadedScene& here = loaded();
                figures.workloads.push_back(
                    cli::about(name, [&] { return here.measure(workload, thread_counts_); }));
                save();
            }
            if (tables()) print(figures, workload.text);
        }
        if (tables()) print_speed_ups(figures);
        std::fflush(stdout);
    }

    void print(const SceneFigures& figures, const std::string& workload) const {
        const bool all_modes =
            options_.all_paths || !options_.isas.empty() || options_.threads_study;
        for (const WorkloadFigures& w : figures.workloads)
            if (w.name == workload) print_workload(figures, w, all_modes);
        std::fflush(stdout);
    }

    const CpuBench& options_;
    int threads_;
    std::vector<int> thread_counts_;
    std::vector<Workload> workloads_;
    std::vector<SceneFigures> scenes_, earlier_;
};

}  // namespace

void run_study(const CpuBench& options) { CpuStudy(options).run(); }

}  // namespace raydix::bench
