// One query of distance or overlap through a scene: down the trees over its parts, into meshes,
// shapes and placed scenes, the nearest first. Included once per instruction set by
// near_kernels.cpp.
#if defined(RAYDIX_ENGINE_NEAR_WALK_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_NEAR_WALK_H
#undef RAYDIX_ENGINE_NEAR_WALK_H
#else
#define RAYDIX_ENGINE_NEAR_WALK_H
#endif

#include <hwy/highway.h>

#include <bit>

#include "engine/near_contacts.h"
#include "engine/near_job.h"
#include "engine/near_probes.h"
#include "trace/simd/children.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Visits all leaves below the root that matter to the probe: leaf(word) -> whether the search
/// ends, and so does this.
template <bool compact, bool may_ask, class Probe, class Leaf>
HWY_INLINE bool walk_near(const NearTree& tree, const NearSpace* space, const Probe& probe,
                          NearStack& stack, const Leaf& leaf) {
    const typename Probe::Frame frame = probe.frame(tree, space);
    const std::size_t bottom = stack.top;
    float limit = probe.limit(frame);
    alignas(32) float keys[8];
    std::uint32_t word = 0;
    for (;;) {
        if ((word & wide_leaf_bit) != 0) {
            if (leaf(word)) return true;
            limit = probe.limit(frame);
        } else {
            const auto& node = tree.view.template node<compact>(word);
            std::uint32_t bits = probe.near(frame, node, limit, keys);
            if (std::has_single_bit(bits)) {
                word = node.child[std::countr_zero(bits)];
                continue;
            }
            stack.make_room();
            NearStack::Entry* const all = stack.entries.data();
            const auto entry = [&](std::uint32_t slots) -> NearStack::Entry {
                const auto s = static_cast<std::uint32_t>(std::countr_zero(slots));
                return {keys[s], node.child[s]};
            };
            const std::uint32_t rest = bits & (bits - 1);
            if (std::has_single_bit(rest)) {
                const NearStack::Entry a = entry(bits), b = entry(rest);
                const bool b_first = b.key < a.key;
                all[stack.top++] = b_first ? a : b;
                if constexpr (may_ask) ask_for<compact>(tree.view, all[stack.top - 1].word);
                word = b_first ? b.word : a.word;
                continue;
            }
            // Behind each other by key, the nearest on top.
            const std::size_t first = stack.top;
            std::uint32_t order[8];
            const std::uint32_t count = order_by_entry(bits, keys, order);
            for (std::uint32_t k = 0; k < count; ++k)
                all[first + k] = {keys[order[k]], node.child[order[k]]};
            const std::size_t top = first + count;
            stack.top = top;
            if constexpr (may_ask)
                if (top - first > 1) ask_for<compact>(tree.view, all[top - 2].word);
        }
        const NearStack::Entry* const all = stack.entries.data();
        do {
            if (stack.top == bottom) return false;
            --stack.top;
        } while (!(all[stack.top].key <= limit));
        word = all[stack.top].word;
    }
}

/// A walk through everything that a query's mask shows.
template <class Probe>
class NearWalk {
public:
    NearWalk(NearJob& job, Probe& probe) : job_(job), probe_(probe) { job.stack.top = 0; }

    /// Whether the search ended early.
    bool run() { return visit_scene(*job_.tree, nullptr, 0); }

    /// For probes that get closer: the leaf where the last query ended.
    void start_at(const NearGuess& last) {
        if (last.view == nullptr) return;
        const NearGuess guess = last;  // the leaf may bring a new one
        const NearSpace* const space = guess.placed ? &guess.space : nullptr;
        if (guess.view->is_compact)
            visit_leaf<true>(*guess.view, *guess.mesh, space, guess.number, guess.word);
        else
            visit_leaf<false>(*guess.view, *guess.mesh, space, guess.number, guess.word);
        visited_ = {guess.view, guess.number, guess.word};
    }

private:
    /// Points may be off the faces of parts of triangles, corners in the world are rounded.
    static constexpr double mesh_room = part_room_of_points, parts_room = 0x1p-21;

    bool visit_scene(const SceneTree& scene, const NearSpace* space, std::uint32_t number) {
        if (const MeshTree* const mesh = scene.only_mesh()) {
            if (visit_mesh(*mesh, space, number)) return true;
        } else if (const ShapeTree* const shapes = scene.only_shapes()) {
            if (visit_shapes(*shapes, space, number)) return true;
        } else {
            const auto visit = [&](std::uint32_t part) {
                return visit_part(scene, part, space, number);
            };
            if (walk_parts(scene.near, space, visit) || walk_parts(scene.wild, space, visit))
                return true;
        }
        return visit_flats(scene, space, number);
    }

    template <class Visit>
    HWY_INLINE bool walk_parts(const PartTree& tree, const NearSpace* space, const Visit& visit) {
        if (tree.empty()) return false;
        return walk_near<false, false>(
            {tree.view, parts_room}, space, probe_, job_.stack, [&](std::uint32_t word) {
                const std::uint32_t place = (word & ~wide_leaf_bit) >> 3;
                for (std::uint32_t k = place; k <= place + (word & 7); ++k)
                    if (visit(tree.part[k])) return true;
                return false;
            });
    }

    HWY_NOINLINE bool visit_part(const SceneTree& scene, std::uint32_t part, const NearSpace* space,
                                 std::uint32_t number) {
        const std::size_t meshes = scene.meshes.size(), own = scene.own_part_count();
        if (part < meshes) return visit_mesh(*scene.meshes[part], space, number);
        if (part < own) return visit_shapes(*scene.shapes[part - meshes], space, number);
        return enter(scene, part - own, space, [&](const PlacedScene& placed, const NearSpace& in) {
            if (placed.mesh != nullptr)
                return visit_mesh(*placed.mesh, &in, number + placed.number);
            return visit_scene_alone(*placed.scene, in, number + placed.number);
        });
    }
    /// All but triangles without area, to which other ways lead.
    bool visit_scene_alone(const SceneTree& scene, const NearSpace& space, std::uint32_t number) {
        if (const MeshTree* const mesh = scene.only_mesh())
            return visit_mesh(*mesh, &space, number);
        if (const ShapeTree* const shapes = scene.only_shapes())
            return visit_shapes(*shapes, &space, number);
        const auto visit = [&](std::uint32_t part) {
            return visit_part(scene, part, &space, number);
        };
        return walk_parts(scene.near, &space, visit) || walk_parts(scene.wild, &space, visit);
    }

    /// Triangles without area.
    bool visit_flats(const SceneTree& scene, const NearSpace* space, std::uint32_t number) {
        const NearScene& near = near_scene_of(scene);
        if (!near.has_flats()) return false;
        if (near.flats.part.size() == 1)
            return visit_flat_part(scene, near.flats.part.front(), space, number);
        return walk_parts(near.flats, space, [&](std::uint32_t part) {
            return visit_flat_part(scene, part, space, number);
        });
    }
    HWY_NOINLINE bool visit_flat_part(const SceneTree& scene, std::uint32_t part,
                                      const NearSpace* space, std::uint32_t number) {
        if (part < scene.meshes.size()) {
            const MeshTree& mesh = *scene.meshes[part];
            const FlatTriangles* const flats = flat_triangles_of(mesh, scene.mesh_names);
            return (mesh.mask & job_.mask) != 0 &&
                   visit_triangles<false>(flats->view, mesh, space, number);
        }
        return enter(scene, part - scene.own_part_count(), space,
                     [&](const PlacedScene& placed, const NearSpace& in) {
                         return visit_flats(*placed.scene, &in, number + placed.number);
                     });
    }

    /// Calls inside(placed, space in it) if the mask shows it.
    template <class Inside>
    bool enter(const SceneTree& scene, std::size_t k, const NearSpace* space,
               const Inside& inside) {
        const PlacedScene& placed = scene.placed[k];
        bool seen = (placed.way.mask & job_.mask) != 0;
        for (std::uint32_t w = 0; w < placed.more; ++w)
            seen = seen && (scene.ways[placed.first + w].mask & job_.mask) != 0;
        if (!seen) return false;
        const NearScene& near = near_scene_of(scene);
        const NearWay& way = near.ways[k];
        NearSpace in{space, &way, near.maps.data() + way.first, way.count};
        if (space == nullptr) return inside(placed, in);
        const NearWay whole = compose(*space->way, way);
        in.way = &whole;
        return inside(placed, in);
    }

    bool visit_mesh(const MeshTree& mesh, const NearSpace* space, std::uint32_t number) {
        if ((mesh.mask & job_.mask) == 0 || mesh.tree->empty()) return false;
        return mesh.view.is_compact ? visit_triangles<true>(mesh.view, mesh, space, number)
                                    : visit_triangles<false>(mesh.view, mesh, space, number);
    }
    template <bool compact>
    HWY_NOINLINE bool visit_triangles(const WideView& view, const MeshTree& mesh,
                                      const NearSpace* space, std::uint32_t number) {
        return walk_near<compact, true>(
            {view, mesh_room}, space, probe_, job_.stack, [&](std::uint32_t word) {
                return visit_leaf<compact>(view, mesh, space, number, word);
            });
    }
    template <bool compact>
    HWY_INLINE bool visit_leaf(const WideView& view, const MeshTree& mesh, const NearSpace* space,
                               std::uint32_t number, std::uint32_t word) {
        if (word == visited_.word && &view == visited_.view && number == visited_.number)
            return false;
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3;
        std::uint32_t lanes = ((2u << (word & 7)) - 1) << place % block_lanes;
        const TriangleBlock* block;
        if constexpr (compact) {
            fill_block(view.compact_blocks[place / block_lanes], view.vertices, room_);
            block = &room_;
        } else {
            block = &view.blocks[place / block_lanes];
        }
        if (space != nullptr) {
            lanes = move_triangles(*block, lanes, *space, moved_);
            block = &moved_;
        }
        if (probe_.triangles(*block, lanes, mesh, number, space != nullptr && space->way->mirrors))
            return true;
        if constexpr (requires { probe_.improved(); }) {
            if (probe_.improved()) keep_guess(view, mesh, space, number, word);
        }
        return false;
    }
    void keep_guess(const WideView& view, const MeshTree& mesh, const NearSpace* space,
                    std::uint32_t number, std::uint32_t word) {
        if (space != nullptr && space->outer != nullptr) return;  // its way goes with this walk
        NearGuess& guess = job_.guess;
        guess.view = &view;
        guess.mesh = &mesh;
        guess.number = number;
        guess.word = word;
        guess.placed = space != nullptr;
        if (guess.placed) guess.space = *space;
    }

    bool visit_shapes(const ShapeTree& tree, const NearSpace* space, std::uint32_t number) {
        if ((tree.mask & job_.mask) == 0 || tree.empty() || tree.user() != nullptr) return false;
        return walk_near<false, false>({tree.view, part_room_of_points}, space, probe_, job_.stack,
                                       [&](std::uint32_t word) {
                                           return probe_.shapes(tree, (word & ~wide_leaf_bit) >> 3,
                                                                (word & 7) + 1, space, number);
                                       });
    }

    NearJob& job_;
    Probe& probe_;
    /// A leaf that is done.
    struct {
        const WideView* view = nullptr;
        std::uint32_t number = 0, word = 0;
    } visited_;
    TriangleBlock room_;   // of a compact tree's leaf
    TriangleBlock moved_;  // of an instance's
};

NearBest closest_in_scene(NearJob& job, Vec3 query, float limit) {
    ClosestSink sink(query, limit);
    DistanceProbe<ClosestSink> probe(query, sink);
    NearWalk<DistanceProbe<ClosestSink>> walk(job, probe);
    walk.start_at(job.guess);
    walk.run();
    return sink.best();
}

bool sphere_touches_scene(NearJob& job, const Sphere& sphere, BudgetVector<ScenePrimitive>* found) {
    TouchSink sink(sphere.radius * sphere.radius, found);
    DistanceProbe<TouchSink> probe(sphere.center, sink);
    NearWalk<DistanceProbe<TouchSink>>(job, probe).run();
    return sink.any();
}

bool segment_touches_scene(NearJob& job, const Segment& segment,
                           BudgetVector<ScenePrimitive>* found) {
    TouchSink sink(0, found);
    SegmentProbe probe(segment, sink);
    NearWalk<SegmentProbe>(job, probe).run();
    return sink.any();
}

NearContact sweep_scene(NearJob& job, const SphereSweep& sweep) {
    SweepProbe probe(sweep);
    NearWalk<SweepProbe>(job, probe).run();
    return probe.best();
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
