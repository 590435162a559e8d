#include "engine/moved_instances.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/commit.h"
#include "engine/near_scene.h"
#include "engine/part_tree.h"
#include "engine/settled.h"
#include "exec/progress.h"

namespace raydix {
namespace {

using State = SceneInternals::State;

/// Above this part of all instances a commit of all, whose loops are shared among threads, may be
/// faster.
constexpr std::size_t one_in = 16;

class Moves {
public:
    Moves(State& state, SceneTree& tree) : state_(state), tree_(tree) {}

    /// Where the instances are to go; the tree is as before. False if it must be made anew.
    [[nodiscard]] bool plan(double refit_limit) {
        // What was built anew may have to be built again, for which the links would be too much.
        if (state_.moved.size() > tree_.instances.size() / one_in || !tree_.near.was_refitted)
            return false;
        // One part each: then instances and placed scenes are in the same order.
        if (tree_.placed.size() != tree_.instances.size()) return false;
        std::vector<std::uint32_t> ids = state_.moved;
        std::ranges::sort(ids);
        ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
        for (const std::uint32_t id : ids)
            if (!plan_one(id)) return false;
        in_tree_.emplace(parts_, tree_.extents, tree_.near);
        later_ = std::make_unique<SceneTree::Later>();
        if (near_may_stay())
            std::call_once(later_->near_asked, [&] { later_->near = tree_.later->near; });
        return in_tree_->plan(refit_limit);
    }

    void apply() noexcept {
        in_tree_->apply();
        unite_extents();
        for (const Move& move : moves_) {
            InstanceName& name = tree_.instances[move.instance];
            name.transform = move.geometry->transform;
            name.mask = move.geometry->mask;
            tree_.placed[move.instance].way = WayIn(move.geometry->inverse, name.mask);
            tree_.images[move.instance] = move.image;
        }
        if (later_->near != nullptr) move_near(const_cast<NearScene&>(*later_->near));
        tree_.later = std::move(later_);
    }

private:
    struct Move {
        std::size_t instance;
        const State::Geometry* geometry;
        Image image;
    };

    [[nodiscard]] bool plan_one(std::uint32_t id) {
        const auto name = std::ranges::lower_bound(tree_.instances, id, {}, &InstanceName::id);
        const auto i = static_cast<std::size_t>(name - tree_.instances.begin());
        const SceneTree& scene = *tree_.placed[i].scene;
        if (tree_.placed[i].more != 0) return false;
        const State::Geometry& geometry = state_.at(id);
        moves_.push_back({i, &geometry,
                          image_of(affine_of(geometry.transform), geometry.errors,
                                   image_of(scene.extent), scene.extent.error)});
        if (scene.extent.empty()) return true;  // in no tree
        const auto part = static_cast<std::uint32_t>(tree_.own_part_count() + i);
        parts_.push_back({part, extent_of(moves_.back().image, scene.support())});
        const Extent& extent = parts_.back().extent;
        return in_range(extent.box.lo) && in_range(extent.box.hi) && !is_wild(extent) &&
               !is_wild(tree_.extents[part]);
    }

    /// Whether what queries of distance made of the scene needs no more than other ways out of what
    /// moves: no triangle without area is in it, and its largest coordinate is that of another
    /// part.
    [[nodiscard]] bool near_may_stay() const {
        const NearScene* const near = tree_.later->near.get();
        return near != nullptr && !near->has_flats() &&
               std::ranges::all_of(moves_,
                                   [&](const Move& move) {
                                       return near->ways[move.instance].size < near->reach;
                                   }) &&
               std::ranges::all_of(parts_, [&](const MovedPart& moved) {
                   return largest_coordinate(tree_.extents[moved.part].box) < near->reach;
               });
    }
    /// The tree is as it will be.
    void move_near(NearScene& near) noexcept {
        if (!tree_.extent.empty())
            near.reach = std::max(near.reach, largest_coordinate(tree_.extent.box));
        for (const Move& move : moves_) {
            NearWay& way = near.ways[move.instance];
            const Affine map = affine_of(move.geometry->transform);
            const double reach = near_scene_of(*tree_.placed[move.instance].scene).reach;
            way = placed_by(map, way_within(reach, way.first, way.count));
            near.maps[way.first] = map;
            near.reach = std::max(near.reach, way.size);
        }
        near.has_answers = 0;
    }

    /// parts_ has where they were.
    void unite_extents() {
        const bool less = std::ranges::any_of(parts_, [&](const MovedPart& moved) {
            const Extent& now = tree_.extents[moved.part];
            return may_shrink(tree_.extent, moved.extent, now) ||
                   may_shrink({tree_.bounds, tree_.extent.error}, moved.extent, now);
        });
        if (less) {
            unite_all_extents();
            return;
        }
        for (const MovedPart& moved : parts_) {
            const Extent& now = tree_.extents[moved.part];
            tree_.extent = unite(tree_.extent, now);
            tree_.bounds = unite(tree_.bounds, now.box);
        }
    }

    /// As a commit of all does it.
    void unite_all_extents() {
        tree_.extent = {};
        for (const Extent& extent : tree_.extents) tree_.extent = unite(tree_.extent, extent);
        const std::size_t own = tree_.own_part_count();
        tree_.bounds = empty_box();
        for (const auto& mesh : tree_.meshes)
            if (!mesh->tree->empty())
                tree_.bounds = unite(tree_.bounds, mesh->tree->arrays().bounds);
        for (const auto& shapes : tree_.shapes) tree_.bounds = unite(tree_.bounds, shapes->bounds);
        for (std::size_t part = own; part < tree_.extents.size(); ++part)
            tree_.bounds = unite(tree_.bounds, tree_.extents[part].box);
    }

    State& state_;
    SceneTree& tree_;
    std::vector<Move> moves_;
    std::vector<MovedPart> parts_;
    std::optional<PartMoves> in_tree_;
    std::unique_ptr<SceneTree::Later> later_;
};

/// Whether nobody else holds the tree.
bool holds_alone(const State& state) {
    if (state.tree.use_count() != 1) return false;
    // Whoever held it last may have let it go on another thread: what happened there is before what
    // follows here, as the count is changed here too.
    std::shared_ptr<const SceneTree>(state.tree).reset();
    return true;
}

}  // namespace

bool take_moves(State& state, const SceneOptions& options, CommitReport& report) {
    check_threads(options.threads);
    if (!state.only_moved || options.usage != Usage::moving || options.refit_limit < 1 ||
        !is_settled_below(state, options) || !holds_alone(state))
        return false;
    const FloatEnvironment plain;
    auto& tree = const_cast<SceneTree&>(*state.tree);  // no constant object, and nobody else's
    Moves moves(state, tree);
    if (!moves.plan(options.refit_limit)) return false;
    ProgressListener listener(options.progress);
    listener.reach(0);
    listener.finish();
    if (!holds_alone(state)) {  // the listener had another scene take it
        SceneOptions told = options;
        told.progress = nullptr;
        auto anew = make_scene_tree(state, told, report);
        state.take(std::move(anew), report, options.refit_limit);
        return true;
    }
    moves.apply();
    report = report_of_no_change(*state.report);
    report.parts_refitted = !tree.near.empty() || !tree.wild.empty();
    state.report = report;
    state.changed = state.only_moved = false;
    state.moved.clear();
    return true;
}

}  // namespace raydix
