// Structs of figures -> dicts.
#include "figures.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

namespace nb = nanobind;

namespace raydix::python {

nb::dict tree_figures(const TreeStats& stats) {
    nb::dict fields;
    fields["nodes"] = stats.nodes;
    fields["leaves"] = stats.leaves;
    fields["references"] = stats.references;
    fields["layout_nodes"] = stats.layout_nodes;
    fields["max_depth"] = stats.max_depth;
    fields["depth_bound"] = nb::cast(stats.depth_bound);
    fields["sah"] = nb::cast(stats.sah);
    fields["epo"] = nb::cast(stats.epo);
    fields["bytes"] = stats.bytes;
    fields["tree_hash"] = stats.tree_hash;
    return fields;
}

nb::dict wide_figures(const WideBvhStats& stats) {
    nb::dict fields;
    fields["width"] = stats.width;
    fields["nodes"] = stats.nodes;
    fields["leaves"] = stats.leaves;
    fields["references"] = stats.references;
    fields["max_depth"] = stats.max_depth;
    fields["children_per_node"] = stats.children_per_node;
    fields["sah"] = stats.sah > 0 ? nb::cast(stats.sah) : nb::none();  // 0: a root without area
    fields["widening"] = stats.widening;
    fields["node_bytes"] = stats.node_bytes;
    fields["triangle_bytes"] = stats.triangle_bytes;
    fields["bytes"] = stats.bytes;
    fields["ms"] = stats.ms;
    fields["left_out"] = stats.left_out;
    return fields;
}

namespace {

template <class Box>
nb::tuple corners_of(const Box& box) {
    return nb::make_tuple(nb::make_tuple(box.lo.x, box.lo.y, box.lo.z),
                          nb::make_tuple(box.hi.x, box.hi.y, box.hi.z));
}

}  // namespace

nb::tuple corners(const Aabb& box) { return corners_of(box); }
nb::tuple corners(const AabbD& box) { return corners_of(box); }

template <class Scalar>
nb::dict mesh_figures(const BasicMeshInfo<Scalar>& info) {
    nb::dict fields;
    fields["vertices"] = info.vertices;
    fields["triangles"] = info.triangles;
    fields["points"] = info.points;
    fields["bounds"] = corners(info.bounds);
    fields["non_finite_vertices"] = info.non_finite_vertices;
    fields["out_of_range_vertices"] = info.out_of_range_vertices;
    fields["unreferenced_vertices"] = info.unreferenced_vertices;
    fields["zero_area_triangles"] = info.zero_area_triangles;
    fields["repeated_index_triangles"] = info.repeated_index_triangles;
    fields["left_out_triangles"] = info.left_out_triangles;
    fields["bytes"] = info.bytes;
    return fields;
}
template nb::dict mesh_figures(const MeshInfo& info);
template nb::dict mesh_figures(const MeshInfoD& info);

nb::dict commit_figures(const CommitReport& report) {
    nb::dict fields;
    fields["ms"] = report.ms;
    fields["meshes"] = report.meshes;
    fields["instances"] = report.instances;
    fields["triangles"] = report.triangles;
    fields["shapes"] = report.shapes;
    fields["primitives"] = report.primitives;
    fields["left_out"] = report.left_out;
    fields["trees_built"] = report.trees_built;
    fields["trees_refitted"] = report.trees_refitted;
    fields["sah_ratio"] = report.sah_ratio;
    fields["parts_refitted"] = report.parts_refitted;
    fields["bytes"] = report.bytes;
    fields["paths"] = report.paths;
    return fields;
}

namespace {

template <class AnyCamera>
nb::dict figures_of(const AnyCamera& camera) {
    const auto coordinates = [](const auto& v) { return nb::make_tuple(v.x, v.y, v.z); };
    nb::dict fields;
    fields["position"] = coordinates(camera.position);
    fields["target"] = coordinates(camera.target);
    fields["up"] = coordinates(camera.up);
    fields["vfov"] = camera.vfov;
    fields["name"] = camera.name;
    return fields;
}

template <class AnyCamera, class Fields>
AnyCamera camera_from(const Fields& fields) {
    return {.name = std::get<4>(fields),
            .position = point_of(std::get<0>(fields)),
            .target = point_of(std::get<1>(fields)),
            .up = point_of(std::get<2>(fields)),
            .vfov = std::get<3>(fields)};
}

}  // namespace

nb::dict camera_figures(const Camera& camera) { return figures_of(camera); }
nb::dict camera_figures(const CameraD& camera) { return figures_of(camera); }

void warn_of_cameras(const std::string& fault) {
    const std::string text = fault + "; the camera is one that sees all";
    if (!fault.empty() && PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0)
        throw nb::python_error();
}

Camera camera_of(const CameraFields<float>& fields) { return camera_from<Camera>(fields); }
CameraD camera_of(const CameraFields<double>& fields) { return camera_from<CameraD>(fields); }

nb::dict stage_ms(const BuildMs& ms) {
    nb::dict fields;
    fields["bounds"] = ms.bounds;
    fields["codes"] = ms.codes;
    fields["sort"] = ms.sort;
    fields["hierarchy"] = ms.hierarchy;
    fields["fit"] = ms.fit;
    fields["layout"] = ms.layout;
    fields["total"] = ms.total;
    return fields;
}

}  // namespace raydix::python
