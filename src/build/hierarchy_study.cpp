// study_hierarchy: bounds, codes and sort as in any build, then each case counted once, and all
// cases timed in rounds.
#include <raydix/error.h>
#include <raydix/hierarchy_study.h>

#include <algorithm>
#include <memory>
#include <string>

#include "base/median.h"
#include "base/options.h"
#include "build/study_scene.h"
#include "exec/parallel.h"
#include "tree/lbvh_family.h"

namespace raydix {
namespace {

constexpr std::string_view builders[] = {"karras", "apetrei", "garanzha", "lauterbach"};

/// Where boxes are fitted by levels. Those that lauterbach launches are bits of the code, which are
/// more than the tree has.
bool goes_by_levels(const CountedBuild& build) {
    return std::ranges::find(build.launches, "fit.level", &LaunchRecord::label) !=
           build.launches.end();
}

/// One mesh: counted, then timed in rounds.
class AnyStudy {
public:
    AnyStudy() = default;
    virtual ~AnyStudy() = default;
    AnyStudy(const AnyStudy&) = delete;
    AnyStudy& operator=(const AnyStudy&) = delete;
    virtual void count() = 0;
    virtual void round(bool counts) = 0;
    virtual std::vector<HierarchyRun> take() = 0;
};

template <class Key, class Source>
class Study : public AnyStudy {
public:
    Study(const Source& source, std::uint32_t n, const Bounds& bounds, const StudyOptions& options)
        : scene_(source, n, bounds), options_(options) {}

    void count() override {
        for (const StudyCase& what : options_.cases) runs_.push_back(count(what));
        times_.resize(runs_.size());
        for (std::size_t k = 0; k < runs_.size(); ++k) times_[k].resize(runs_[k].launches.size());
    }
    void round(bool counts) override {
        for (std::size_t k = 0; k < runs_.size(); ++k) time(k, counts);
    }
    std::vector<HierarchyRun> take() override {
        for (std::size_t k = 0; k < runs_.size(); ++k)
            for (std::size_t l = 0; l < times_[k].size(); ++l)
                runs_[k].launches[l].ms = median(times_[k][l]);
        return std::move(runs_);
    }

private:
    template <class Probe>
    CountedBuild go(const StudyCase& what) {
        if (!what.is_builder()) return StageRun<Key, Source, Probe>(scene_, options_).run(what);
        const BuildWay way{builder_from_name(what.subject), what.fit, what.form};
        const std::span<const Key> keys = scene_.keys;
        return Probe::counts
                   ? count_build<Key>(way, keys, scene_.boxes, options_.max_leaf, scene_.memory)
                   : time_build<Key>(way, keys, scene_.boxes, options_.max_leaf, scene_.memory);
    }

    HierarchyRun count(const StudyCase& what) {
        HierarchyRun run{.what = what,
                         .bits = options_.bits,
                         .max_leaf = options_.max_leaf,
                         .threads = thread_count(),
                         .keys = scene_.valid};
        if (scene_.valid == 0) return run;
        try {
            const CountedBuild counted = go<CountProbe>(what);
            run.inner_nodes = counted.inner_count;
            run.max_depth = counted.max_depth;
            run.digest = counted.digest;
            for (const LaunchRecord& r : counted.launches)
                run.launches.push_back({r.label, r.items, r.bytes, r.steps, r.longest_chain, 0});
            if (goes_by_levels(counted)) run.items_per_level = counted.inner_per_level;
        } catch (const InputError& error) {  // more memory than the builder may take, larger leaves
            run.refusal = error.what();
        }
        return run;
    }

    void time(std::size_t k, bool counts) {
        if (runs_[k].launches.empty()) return;
        const CountedBuild timed = go<NoProbe>(runs_[k].what);
        for (std::size_t l = 0; counts && l < times_[k].size(); ++l)
            times_[k][l].push_back(timed.launches[l].ms);
    }

    StudyScene<Key, Source> scene_;
    const StudyOptions& options_;
    std::vector<HierarchyRun> runs_;
    std::vector<std::vector<std::vector<double>>> times_;  // [case][launch][round]
};

std::unique_ptr<AnyStudy> study_of(const MeshView& mesh, const StudyOptions& options) {
    const auto make = [&](const auto& source, std::size_t count) -> std::unique_ptr<AnyStudy> {
        using Source = std::decay_t<decltype(source)>;
        const auto n = static_cast<std::uint32_t>(count);
        const Bounds bounds = scene_bounds(source, n);
        if (bounds.first_unreadable != no_primitive)
            throw InputError("triangle " + std::to_string(bounds.first_unreadable) +
                             ": an index is past the last vertex");
        if (options.bits == 30)
            return std::make_unique<Study<std::uint32_t, Source>>(source, n, bounds, options);
        return std::make_unique<Study<std::uint64_t, Source>>(source, n, bounds, options);
    };
    if (mesh.triangles.empty())
        return make(PointSource{mesh.vertices.data()}, mesh.vertices.size());
    return make(TriangleSource{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()},
                mesh.triangles.size());
}

void check(const StudyOptions& options) {
    if (options.bits != 30 && options.bits != 63)
        throw InputError("bits is " + std::to_string(options.bits) + "; 30 and 63 are possible");
    if (options.max_leaf < 1 || options.max_leaf > 255)
        throw InputError("max_leaf is " + std::to_string(options.max_leaf) +
                         "; 1 to 255 are possible");
    if (options.repeat < 1)
        throw InputError("repeat is " + std::to_string(options.repeat) + "; at least 1 is needed");
    const std::vector<StudyCase> known = study_cases();
    for (const StudyCase& what : options.cases) {
        check_enum("form", what.form, StudyForm::tuned);
        check_enum("fit", what.fit, Fit::atomic);
        const auto is_what = [&](const StudyCase& other) {
            return other.subject == what.subject && other.form == what.form &&
                   (!what.is_builder() || other.fit == what.fit);
        };
        if (std::ranges::none_of(known, is_what))
            throw InputError("the study has no case " + what.name());
    }
}

}  // namespace

std::string_view study_form_name(StudyForm form) {
    return form == StudyForm::launches    ? "launches"
           : form == StudyForm::published ? "published"
                                          : "tuned";
}

bool StudyCase::is_builder() const {
    return std::ranges::find(builders, subject) != std::end(builders);
}

std::string StudyCase::name() const {
    std::string text = subject;
    if (form != StudyForm::launches) text += ", " + std::string(study_form_name(form));
    if (is_builder())
        text += fit == Fit::levels   ? ", boxes by levels"
                : fit == Fit::atomic ? ", boxes in one pass"
                                     : ", boxes as published";
    return text;
}

std::vector<StudyCase> study_cases() {
    using enum StudyForm;
    return {{"codes", launches},
            {"codes", tuned},
            {"sort", launches},
            {"sort", tuned},
            {"karras", published, Fit::atomic},
            {"karras", launches, Fit::atomic},
            {"karras", launches, Fit::levels},
            {"karras", tuned, Fit::atomic},
            {"apetrei", launches, Fit::atomic},
            {"apetrei", launches, Fit::levels},
            {"apetrei", tuned, Fit::atomic},
            {"garanzha", published, Fit::levels},
            {"garanzha", published, Fit::atomic},
            {"garanzha", launches, Fit::levels},
            {"garanzha", launches, Fit::atomic},
            {"lauterbach", launches, Fit::levels},
            {"lauterbach", launches, Fit::atomic},
            {"octree", launches},
            {"kdtree", launches}};
}

std::vector<std::vector<HierarchyRun>> study_hierarchies(std::span<const MeshView> meshes,
                                                         const StudyOptions& options) {
    check(options);
    std::vector<std::vector<HierarchyRun>> runs;
    with_threads(options.threads, [&] {
        std::vector<std::unique_ptr<AnyStudy>> studies;
        for (std::size_t i = 0; i < meshes.size(); ++i) {
            try {
                studies.push_back(study_of(meshes[i], options));
            } catch (const InputError& error) {
                if (meshes.size() == 1) throw;
                throw InputError("mesh " + std::to_string(i) + ": " + error.what());
            }
            studies.back()->count();
        }
        for (int round = 0; round <= options.repeat; ++round)  // the first one warms up
            for (const auto& study : studies) study->round(round > 0);
        for (const auto& study : studies) runs.push_back(study->take());
    });
    return runs;
}

std::vector<HierarchyRun> study_hierarchy(const MeshView& mesh, const StudyOptions& options) {
    return std::move(study_hierarchies(std::span(&mesh, 1), options).front());
}

}  // namespace raydix
