// Trees as arrays: BVHs, octrees and k-d trees with their statistics.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <raydix/bvh.h>
#include <raydix/check.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"
#include "figures.h"

namespace raydix::python {
namespace {

/// Without triangles a mesh is its vertices, as points.
MeshView mesh_view(const PointsIn& vertices, const FacesIn& faces) {
    return {rows<Vec3>(vertices), rows<Triangle>(faces)};
}

/// What all three trees have: nodes as raw records (the package knows their fields), the order of
/// primitives in leaves, times.
template <class Tree>
nb::class_<Tree> bind_tree(nb::module_& module, const char* name, const char* text) {
    nb::class_<Tree> bound(module, name, text);
    bound.def_prop_ro("nodes", [](nb::handle_t<Tree> self) {
        return view_rows<std::uint8_t>(nb::cast<const Tree&>(self).nodes(), self);
    });
    bound.def_prop_ro("order", [](nb::handle_t<Tree> self) {
        const auto order = nb::cast<const Tree&>(self).order();
        return Array1<const std::uint32_t>(order.data(), {order.size()}, self);
    });
    bound.def_prop_ro("ms", [](const Tree& tree) { return stage_ms(tree.build_ms()); });
    bound.def_prop_ro("left_out", [](const Tree& tree) { return tree.left_out(); });
    bound.def_prop_ro("peak_bytes", [](const Tree& tree) { return tree.peak_bytes(); });
    bound.def_prop_ro("max_leaf", [](const Tree& tree) { return tree.options().max_leaf; });
    return bound;
}

void require_ok(const CheckReport& report) {
    if (!report.ok) throw std::runtime_error(report.broken);
}

void bind_bvh(nb::module_& module) {
    bind_tree<Bvh>(module, "Bvh", "A binary tree; raydix.bvh makes one.")
        .def(
            "__init__",
            [](Bvh* self, const PointsIn& vertices, const FacesIn& faces,
               const std::string& builder, int bits, int max_leaf, bool strict, int threads) {
                const BuildOptions options{.builder = builder_from_name(builder),
                                           .bits = bits,
                                           .max_leaf = max_leaf,
                                           .strict = strict,
                                           .threads = threads_for(threads)};
                const MeshView mesh = mesh_view(vertices, faces);
                const nb::gil_scoped_release unlocked;
                new (self) Bvh(build_bvh(mesh, options));
            },
            nb::arg("vertices").noconvert(), nb::arg("faces").noconvert(), nb::arg("builder"),
            nb::arg("bits"), nb::arg("max_leaf"), nb::arg("strict"), nb::arg("threads"))
        .def(
            "stats",
            [](const Bvh& tree, bool epo, double node_cost, double primitive_cost) {
                TreeStats stats;
                {
                    const nb::gil_scoped_release unlocked;
                    stats = tree_stats(tree, {.sah = {node_cost, primitive_cost},
                                              .with_epo = epo,
                                              .threads = threads_for(0)});
                }
                return tree_figures(stats);
            },
            nb::arg("epo") = false, nb::arg("node_cost") = 1.0, nb::arg("primitive_cost") = 1.0)
        .def(
            "check", [](const Bvh& tree) { require_ok(check(tree)); },
            nb::call_guard<nb::gil_scoped_release>());
}

OctreeOptions octree_options(int bits, int max_level, int max_leaf, bool strict, int threads) {
    return {.bits = bits,
            .max_level = max_level,
            .max_leaf = max_leaf,
            .strict = strict,
            .threads = threads_for(threads)};
}

nb::dict octree_figures(const Octree& tree) {
    OctreeStats stats;
    {
        const nb::gil_scoped_release unlocked;
        stats = octree_stats(tree);
    }
    nb::dict fields;
    fields["nodes"] = stats.nodes;
    fields["leaves"] = stats.leaves;
    fields["references"] = stats.references;
    fields["max_depth"] = stats.max_depth;
    fields["max_level"] = stats.max_level;
    fields["largest_leaf"] = stats.largest_leaf;
    fields["nodes_per_level"] = nb::cast(stats.nodes_per_level);
    fields["bytes"] = stats.bytes;
    fields["tree_hash"] = stats.tree_hash;
    return fields;
}

Array2<float> octree_boxes(const Octree& tree, const In<std::uint32_t, nb::ndim<1>>& nodes) {
    Buffer<Aabb> boxes(nodes.shape(0));
    for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i] = node_box(tree, nodes.data()[i]);
    return hand_over_rows<float>(std::move(boxes));
}

void bind_octree(nb::module_& module) {
    bind_tree<Octree>(module, "Octree", "An octree; raydix.octree makes one.")
        .def(
            "__init__",
            [](Octree* self, const PointsIn& vertices, const FacesIn& faces, int bits,
               int max_level, int max_leaf, bool strict, int threads) {
                const auto options = octree_options(bits, max_level, max_leaf, strict, threads);
                const MeshView mesh = mesh_view(vertices, faces);
                const nb::gil_scoped_release unlocked;
                new (self) Octree(build_octree(mesh, options));
            },
            nb::arg("vertices").noconvert(), nb::arg("faces").noconvert(), nb::arg("bits"),
            nb::arg("max_level"), nb::arg("max_leaf"), nb::arg("strict"), nb::arg("threads"))
        .def_prop_ro("points",
                     [](nb::handle_t<Octree> self) {
                         return view_rows<float>(nb::cast<const Octree&>(self).points(), self);
                     })
        .def_prop_ro("bounds", [](const Octree& tree) { return corners(tree.bounds()); })
        .def("stats", &octree_figures)
        .def("boxes", &octree_boxes, nb::arg("nodes").noconvert())
        .def(
            "locate",
            [](const Octree& tree, const PointsIn& points) {
                const auto queries = rows<Vec3>(points);
                std::vector<std::uint32_t> nodes;
                {
                    const nb::gil_scoped_release unlocked;
                    nodes = locate(tree, queries, threads_for(0));
                }
                return hand_over(std::move(nodes));
            },
            nb::arg("points").noconvert())
        .def(
            "points_in_boxes",
            [](const Octree& tree, const In<float, nb::shape<-1, 6>>& boxes,
               std::uint64_t max_result_bytes) {
                const auto queries = rows<Aabb>(boxes);
                PointsInBoxes found;
                {
                    const nb::gil_scoped_release unlocked;
                    found = points_in_boxes(tree, queries, threads_for(0), max_result_bytes);
                }
                return nb::make_tuple(hand_over(std::move(found.offsets)),
                                      hand_over(std::move(found.ids)));
            },
            nb::arg("boxes").noconvert(), nb::arg("max_result_bytes") = 0)
        .def(
            "check", [](const Octree& tree) { require_ok(check(tree)); },
            nb::call_guard<nb::gil_scoped_release>());
}

void bind_kdtree(nb::module_& module) {
    bind_tree<KdTree>(module, "KdTree", "A k-d tree; raydix.kdtree makes one.")
        .def(
            "__init__",
            [](KdTree* self, const PointsIn& vertices, const FacesIn& faces, int bits, int max_leaf,
               bool strict, int threads) {
                const KdTreeOptions options{.bits = bits,
                                            .max_leaf = max_leaf,
                                            .strict = strict,
                                            .threads = threads_for(threads)};
                const MeshView mesh = mesh_view(vertices, faces);
                const nb::gil_scoped_release unlocked;
                new (self) KdTree(build_kdtree(mesh, options));
            },
            nb::arg("vertices").noconvert(), nb::arg("faces").noconvert(), nb::arg("bits"),
            nb::arg("max_leaf"), nb::arg("strict"), nb::arg("threads"))
        .def_prop_ro("bounds", [](const KdTree& tree) { return corners(tree.bounds()); })
        .def("stats",
             [](const KdTree& tree) {
                 TreeStats stats;
                 {
                     const nb::gil_scoped_release unlocked;
                     stats = kd_stats(tree);
                 }
                 return tree_figures(stats);
             })
        .def(
            "check", [](const KdTree& tree) { require_ok(kd_check(tree)); },
            nb::call_guard<nb::gil_scoped_release>());
}

std::vector<std::string> builder_names() {
    std::vector<std::string> names;
    for (std::uint32_t i = 0; i <= static_cast<std::uint32_t>(Builder::sbvh); ++i)
        names.emplace_back(builder_name(static_cast<Builder>(i)));
    return names;
}

}  // namespace

void bind_trees(nb::module_& module) {
    module.def("builders", &builder_names, "Names of the builders of BVHs.");
    bind_bvh(module);
    bind_octree(module);
    bind_kdtree(module);
}

}  // namespace raydix::python
