// Paths are counted first, each inner scene once however often it stands; then those with triangles
// are walked, depth first.
#include "engine/flat_scene.h"

#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "base/mirrors.h"
#include "engine/affine.h"
#include "engine/affine_double.h"
#include "engine/merge.h"
#include "engine/shape_tree.h"
#include "exec/join_copies.h"
#include "exec/parallel.h"
#include "exec/result_memory.h"
#include "primitives/double_sources.h"
#include "primitives/sources.h"

namespace raydix {
namespace {

/// Shapes of a scene that queries see; null if there are none.
template <class Tree>
auto seen_shapes(const Tree& scene, std::uint32_t mask) -> decltype(scene.shapes.front().get()) {
    for (const auto& shapes : scene.shapes)
        if ((shapes->mask & mask) != 0 && !shapes->empty()) return shapes.get();
    return nullptr;
}

constexpr std::size_t no_way = ~std::size_t{0};

/// A way out of an instance. Map: Affine or AffineD.
template <class Map>
struct WayOut {
    Map map;
    std::size_t outer;  // the way that goes on from there; no_way: this is the world
    bool mirrors;       // with those that follow
};

/// A mesh on a path.
template <class Scalar>
struct FlatCopy {
    using Transform = BasicTransform<Scalar>;
    using Way = WayOut<decltype(affine_of(std::declval<Transform>()))>;

    BasicMeshView<Scalar> mesh;
    std::uint64_t first_vertex, first_triangle;
    const std::vector<Way>* ways;
    std::size_t way;  // the innermost one

    /// Whether its own mesh has a place for a triangle.
    [[nodiscard]] bool counts(std::uint32_t triangle) const {
        using Source =
            std::conditional_t<std::is_same_v<Scalar, float>, TriangleSource, TriangleSourceD>;
        BasicAabb<Scalar> box;
        return Source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()}.box(
            triangle, box);
    }
    [[nodiscard]] bool mirrors() const { return way != no_way && (*ways)[way].mirrors; }
    [[nodiscard]] auto mover() const {
        return [this](const auto& vertex) {
            auto out = vertex;
            if (way == no_way) return out;
            Double3 p(vertex);
            for (std::size_t at = way; at != no_way; at = (*ways)[at].outer)
                p = (*ways)[at].map.vector(p) + (*ways)[at].map.move;
            p.round_to(out);
            return without_negative_zero(out);
        };
    }
};

/// What a mesh leaves out is nowhere, however near an instance brings it and however large it makes
/// it: such triangles get the last vertex of `out`, which is no place.
template <class Scalar>
void drop_what_meshes_leave_out(std::span<const FlatCopy<Scalar>> copies, BasicMesh<Scalar>& out) {
    const auto nowhere = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.push_back({NAN, NAN, NAN});
    for_each_part_of_copies(
        copies, &FlatCopy<Scalar>::first_triangle, out.triangles.size(),
        [&](const FlatCopy<Scalar>& copy, std::size_t begin, std::size_t end) {
            if (copy.way == no_way) return;  // a build leaves it out
            for (std::size_t i = begin; i < end; ++i)
                if (!copy.counts(static_cast<std::uint32_t>(i)))
                    out.triangles[copy.first_triangle + i] = {nowhere, nowhere, nowhere};
        });
}

/// More than a build holds at any time for each triangle, the tree included. Measured are 76 in
/// float and 123 in double for quality fast, 221 and 234 for the others.
template <class Scalar>
std::uint64_t build_bytes_a_triangle(Quality quality) {
    if (quality == Quality::fast) return std::is_same_v<Scalar, float> ? 110 : 170;
    return std::is_same_v<Scalar, float> ? 290 : 310;
}

}  // namespace

auto FlatNames::run_of(std::uint32_t prim) const -> const Run& {
    const auto past =
        std::upper_bound(runs.begin(), runs.end(), prim,
                         [](std::uint32_t wanted, const Run& run) { return wanted < run.first; });
    return *(past - 1);
}

/// All paths with triangles, as copies and the ways out of them.
template <class Scalar>
class FlatPlan<Scalar>::Paths {
public:
    using Copy = FlatCopy<Scalar>;

    Paths(const FlatPlan& plan, FlatScene<Scalar>& out) : plan_(plan), out_(out) {
        const FlatCounts& counts = plan.counts();
        ways.reserve(counts.instances);
        copies.reserve(counts.meshes);
        out.names.runs.reserve(counts.meshes);
        walk(*plan.tree_, 0, no_way);
    }

    std::vector<typename Copy::Way> ways;
    std::vector<Copy> copies;

private:
    /// `number`: of the path that leads here.
    void walk(const Tree& scene, std::uint32_t number, std::size_t way) {
        for (const auto& name : scene.mesh_names) {
            if ((name.mask & plan_.mask_) == 0 || name.mesh.triangles.empty()) continue;
            copies.push_back({name.mesh, vertices_, triangles_, &ways, way});
            out_.names.runs.push_back(
                {static_cast<std::uint32_t>(triangles_), number, name.id, copies.back().mirrors()});
            vertices_ += name.mesh.vertices.size();
            triangles_ += name.mesh.triangles.size();
        }
        for (const auto& instance : scene.instances) {
            const Tree& inner = *instance.scene;
            if ((instance.mask & plan_.mask_) == 0 || plan_.counts_of(inner).triangles == 0)
                continue;
            const auto map = affine_of(instance.transform);
            const bool turned = mirrors(map.x, map.y, map.z);
            ways.push_back({map, way, turned != (way != no_way && ways[way].mirrors)});
            walk(inner, number + instance.number, ways.size() - 1);
        }
    }

    const FlatPlan& plan_;
    FlatScene<Scalar>& out_;
    std::uint64_t vertices_ = 0, triangles_ = 0;
};

template <class Scalar>
FlatPlan<Scalar>::FlatPlan(const Scene& scene, std::uint32_t mask, const char* call,
                           FlatShapes shapes)
    : tree_(BasicSceneInternals<Scalar>::tree(scene)), mask_(mask) {
    if (count(*tree_).has_shapes && shapes == FlatShapes::refused) refuse_shapes(*tree_, 0, call);
}

template <class Scalar>
const FlatCounts& FlatPlan<Scalar>::count(const Tree& scene) {
    const auto known = counts_.find(&scene);
    if (known != counts_.end()) return known->second;
    FlatCounts sum;
    sum.has_shapes = seen_shapes(scene, mask_) != nullptr;
    for (const auto& name : scene.mesh_names) {
        if ((name.mask & mask_) == 0 || name.mesh.triangles.empty()) continue;
        ++sum.meshes;
        sum.triangles += name.mesh.triangles.size();
        sum.vertices += name.mesh.vertices.size();
    }
    for (const auto& instance : scene.instances) {
        if ((instance.mask & mask_) == 0) continue;
        const FlatCounts& inner = count(*instance.scene);
        sum.triangles = saturating_sum(sum.triangles, inner.triangles);
        sum.vertices = saturating_sum(sum.vertices, inner.vertices);
        sum.meshes = saturating_sum(sum.meshes, inner.meshes);
        sum.has_shapes |= inner.has_shapes;
        if (inner.triangles != 0)
            sum.instances = saturating_sum(sum.instances, saturating_sum(1, inner.instances));
    }
    return counts_.emplace(&scene, sum).first->second;
}

template <class Scalar>
void FlatPlan<Scalar>::refuse_shapes(const Tree& scene, std::uint32_t number,
                                     const char* call) const {
    if (const auto* const shapes = seen_shapes(scene, mask_))
        throw InputError(std::string(call) + ": " + name_of(*shapes, number) +
                         " is no triangle mesh");
    for (const auto& instance : scene.instances)
        if ((instance.mask & mask_) != 0 && counts_of(*instance.scene).has_shapes)
            refuse_shapes(*instance.scene, number + instance.number, call);
    throw InputError(call);
}

template <class Scalar>
bool FlatPlan<Scalar>::is_one_mesh() const {
    return counts().meshes == 1 && counts().instances == 0;
}

template <class Scalar>
std::uint64_t FlatPlan<Scalar>::bytes() const {
    const FlatCounts& all = counts();
    std::uint64_t sum = saturating_sum(
        saturating_product(all.meshes, sizeof(FlatNames::Run) + sizeof(FlatCopy<Scalar>)),
        saturating_product(all.instances, sizeof(typename FlatCopy<Scalar>::Way)));
    if (is_one_mesh()) return sum;
    sum = saturating_sum(sum, saturating_product(all.triangles, sizeof(Triangle)));
    return saturating_sum(
        sum, saturating_product(saturating_sum(all.vertices, 1), sizeof(BasicVec3<Scalar>)));
}

template <class Scalar>
FlatScene<Scalar> FlatPlan<Scalar>::flatten() const {
    require_countable(counts().triangles, saturating_sum(counts().vertices, 1));
    FlatScene<Scalar> out;
    const Paths paths(*this, out);
    if (is_one_mesh()) {
        out.mesh = paths.copies.front().mesh;
        return out;
    }
    const std::span<const FlatCopy<Scalar>> copies(paths.copies);
    out.own.vertices.reserve(counts().vertices + 1);
    join_copies(copies, counts().vertices, counts().triangles, out.own);
    if (!paths.ways.empty()) drop_what_meshes_leave_out<Scalar>(copies, out.own);
    out.mesh = out.own;
    return out;
}

template <class Scalar>
void FlatPlan<Scalar>::for_each_mesh(
    const std::function<void(const BasicMeshView<Scalar>&)>& visit) const {
    FlatScene<Scalar> unused;
    const Paths paths(*this, unused);
    for (const FlatCopy<Scalar>& copy : paths.copies) {
        if (copy.way == no_way) {
            visit(copy.mesh);
            continue;
        }
        std::vector<BasicVec3<Scalar>> moved(copy.mesh.vertices.size());
        const auto move = copy.mover();
        for_each_index(moved.size(),
                       [&](std::size_t i) { moved[i] = move(copy.mesh.vertices[i]); });
        visit({moved, copy.mesh.triangles});
    }
}

template <class Scalar>
std::uint64_t FlatPlan<Scalar>::tree_bytes() const {
    return saturating_sum(
        bytes(),
        saturating_product(counts().triangles, build_bytes_a_triangle<Scalar>(tree_->quality)));
}

template <class Scalar>
FlatTree<Scalar> FlatPlan<Scalar>::tree(int threads) const {
    FlatScene<Scalar> flat = flatten();
    BuildOptions options =
        build_options_for(tree_->quality == Quality::fast ? Quality::fast : Quality::balanced);
    options.threads = threads;
    return {build_bvh(flat.mesh, options), std::move(flat.names)};
}

template class FlatPlan<float>;
template class FlatPlan<double>;

}  // namespace raydix
