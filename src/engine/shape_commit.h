// What commits in float and in double share: shapes -> trees, each built, refitted or kept.
#pragma once

#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/left_out.h"
#include "engine/own_geometries.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "exec/progress.h"

namespace raydix {

template <class Scalar>
class ShapeCommit {
public:
    using State = typename BasicSceneInternals<Scalar>::State;
    using ShapeTree = typename SceneKind<Scalar>::ShapeTree;

    ShapeCommit(const State& state, const OwnGeometries<Scalar>& own, const SceneOptions& options,
                CommitReport& report)
        : state_(state), own_(own), options_(options), report_(report) {}

    /// How many primitives there are.
    [[nodiscard]] double work() const {
        double sum = 0;
        for (const auto& [id, geometry] : own_)
            if (geometry->shapes) sum += static_cast<double>(count_of(*geometry->shapes));
        return sum;
    }

    /// take(tree) for each geometry, by ascending id. `all`: the work of which this is a part.
    /// Returns the part of it that is done then.
    template <class Take>
    double run(double all, const Take& take) {
        double done = 0;
        for (const auto& [id, geometry] : own_) {
            if (!geometry->shapes) continue;
            const std::size_t count = count_of(*geometry->shapes);
            const double after = done + static_cast<double>(count);
            const ProgressStage stage(done / all, after / all);
            const auto shapes = shapes_of(id, *geometry);
            done = after;
            progress_at(1);
            take(shapes);
            ++report_.shapes;
            report_.primitives += count;
            report_.bytes += shapes->bytes();
            const std::uint64_t left_out = count - shapes->part.size();
            report_.left_out += left_out;
            if (options_.strict && left_out != 0) refuse(id, *geometry->shapes);
        }
        return all > 0 ? done / all : 0;
    }

private:
    std::shared_ptr<const ShapeTree> shapes_of(std::uint32_t id,
                                               const typename State::Geometry& geometry) {
        const auto old = last_of(id);
        const bool same_way = old != nullptr && state_.tree->quality == options_.quality;
        if (same_way && !geometry.changed && old->mask == geometry.mask) return old;
        const bool may_refit =
            same_way && options_.usage == Usage::moving && options_.refit_limit >= 1;
        bool refitted = false;
        try {
            auto made =
                make_shape_tree(id, geometry.mask, *geometry.shapes, geometry.own, options_.quality,
                                may_refit ? old.get() : nullptr, options_.refit_limit, refitted);
            ++(refitted ? report_.trees_refitted : report_.trees_built);
            return made;
        } catch (const InputError& error) {
            throw InputError("geometry " + std::to_string(id) + ": " + error.what());
        }
    }
    static void refuse(std::uint32_t id, const BasicShapes<Scalar>& shapes) {
        using Box = BasicAabb<Scalar>;
        const std::vector<Box> boxes = boxes_of<Scalar>(shapes);
        constexpr const char* kinds[] = {"sphere", "capsule", "point", "primitive"};
        refuse_left_out<Box>(id, kinds[shapes.index()], source_of(std::span<const Box>(boxes)),
                             boxes.size());
    }
    [[nodiscard]] std::shared_ptr<const ShapeTree> last_of(std::uint32_t id) const {
        if (state_.tree == nullptr) return nullptr;
        const auto& all = state_.tree->shapes;
        const auto at = std::ranges::lower_bound(all, id, {}, &ShapeTree::id);
        return at != all.end() && (*at)->id == id ? *at : nullptr;
    }

    const State& state_;
    const OwnGeometries<Scalar>& own_;
    const SceneOptions& options_;
    CommitReport& report_;
};

}  // namespace raydix
