// Broken, extreme and unusual files of other projects: each has one expected outcome, counts or a
// message.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <map>

#include "support/support.h"

namespace raydix::test {
namespace {

struct Outcome {
    std::size_t vertices = 0, triangles = 0;
    std::string error;  // what follows "FILE: "
};

const std::map<std::string, Outcome>& outcomes() {
    static const std::map<std::string, Outcome> all{
        {"assimp_BoxWithInfinites.glb", {24, 12, ""}},
        {"assimp_OutOfMemory.off",
         {0, 0, "vertex 15: file ends after 14 of 353535235358 vertices"}},
        {"assimp_box_UTF16BE.obj", {0, 0, "line 1: UTF-16 text; only UTF-8 and ASCII are read"}},
        {"assimp_box_longline.obj", {8, 944, ""}},
        {"assimp_concave_polygon.obj", {64, 64, ""}},
        {"assimp_empty.obj", {0, 0, ""}},
        {"assimp_empty.off", {0, 0, "header: the file is empty"}},
        {"assimp_empty.ply", {0, 0, "header: does not start with \"ply\""}},
        {"assimp_invalid.off",
         {0, 0, "face 2: expected an index per corner, found the end in line 7"}},
        {"assimp_issue623.ply", {24, 0, ""}},
        {"assimp_malformed.obj", {0, 0, "line 28: index 0 of 8 vertices"}},
        {"assimp_malformed2.obj", {8, 10, ""}},
        {"assimp_number_formats.obj", {0, 0, "line 11: \"3.1+e2\" is not a number"}},
        {"assimp_point_cloud.obj", {3, 0, ""}},
        {"assimp_points.ply", {4, 0, ""}},
        {"assimp_regr01.obj", {2108, 2710, ""}},
        {"assimp_regr_3429812.obj", {4, 4, ""}},
        {"assimp_sphereWithHole.stl", {855, 285, ""}},
        {"assimp_testline.obj", {8, 0, ""}},
        {"assimp_testmixed.obj", {8, 12, ""}},
        {"assimp_testpoints.obj", {8, 0, ""}},
        {"assimp_triangle_with_two_solids.stl", {6, 2, ""}},
        {"hyg_stars.ply.xz", {107857, 0, ""}},
        {"isprs_samp12_utm_float32.ply.xz", {52119, 0, ""}},
        {"manifold_Cray_left.obj", {292, 576, ""}},
        {"manifold_Havocglass8_left.obj", {84, 164, ""}},
        {"manifold_Offset1.obj", {2287, 4418, ""}},
        {"manifold_openscad-nonmanifold-crash.obj", {717, 1442, ""}},
        {"openscad_adns2610_dev_circuit_inv.stl", {2700, 900, ""}},
        {"openscad_bad-stl-pcbvicebar.stl", {780, 260, ""}},
        {"openscad_bad-stl-tardis.stl", {10908, 3636, ""}},
        {"openscad_bad-stl-wing.stl", {2526, 842, ""}},
        {"openscad_empty2.stl", {0, 0, ""}},
        {"openscad_invalidvertex.stl", {0, 0, "facet 13: \"blah\" is not a number in line 89"}},
        {"openscad_issue1580-back-to-back.stl", {30, 10, ""}},
        {"openscad_issue1580-zero-area-triangle.stl", {42, 14, ""}},
        {"openscad_issue945e.stl", {282, 94, ""}},
        {"openscad_toomanyvertices.stl", {0, 0, "facet 13: 4 vertices instead of 3"}},
        {"openscad_unparseable.stl", {0, 0, "facet 1: \"\\x10\" is not a number in line 4"}},
        {"pcl_organized_nan_640x480.ply.xz", {307200, 0, ""}},
        {"thingi10k_112932.stl", {23640, 7880, ""}},
        {"thingi10k_472042.stl", {10896, 3632, ""}},
        {"thingi10k_520644.stl", {23502, 7834, ""}},
        {"thingi10k_65004.stl", {4398, 1466, ""}},
        {"thingi10k_72214.stl", {4980, 1660, ""}},
        {"trimesh_busted.stl", {11634, 3878, ""}},
        {"trimesh_multi.ply", {4, 2, ""}},
        {"trimesh_multibody.stl", {96, 32, ""}},
        {"trimesh_nancolor.obj", {8, 12, ""}},
        {"trimesh_negative_indices.obj", {8, 12, ""}},
        {"trimesh_not_convex.obj", {288, 96, ""}},
        {"trimesh_notenoughindices.obj", {3, 1, ""}},
        {"trimesh_ply_empty_bin.ply", {0, 0, ""}},
        {"trimesh_ply_empty_header.ply", {0, 0, ""}},
        {"trimesh_points_agisoft.xyz", {100, 0, ""}},
        {"trimesh_points_ascii_with_lists.ply", {5, 0, ""}},
        {"trimesh_points_emptyface.ply", {1024, 0, ""}},
        {"trimesh_polygonfaces.obj", {5, 3, ""}},
        {"trimesh_soup.stl", {300, 100, ""}},
        {"trimesh_stl_empty_bin.stl", {0, 0, ""}},
    };
    return all;
}

TEST(Nasty, each_file_has_its_outcome) {
    const auto root = shared_scene("nasty");
    RAYDIX_SKIP_WITHOUT(root);
    std::size_t seen = 0;
    for (const auto& entry : std::filesystem::directory_iterator(root)) {
        const std::string name = entry.path().filename().string();
        const auto expected = outcomes().find(name);
        ASSERT_NE(expected, outcomes().end()) << name << " is new: give it an outcome";
        ++seen;
        try {
            const Mesh mesh = load_mesh(entry.path());
            EXPECT_EQ(expected->second.error, "") << name << " loaded";
            EXPECT_EQ(mesh.vertices.size(), expected->second.vertices) << name;
            EXPECT_EQ(mesh.triangles.size(), expected->second.triangles) << name;
            const MeshInfo info = inspect(mesh);
            EXPECT_LE(info.left_out_triangles, info.triangles) << name;
        } catch (const InputError& error) {
            EXPECT_EQ(std::string(error.what()),
                      entry.path().string() + ": " + expected->second.error);
        }
    }
    EXPECT_EQ(seen, outcomes().size());
}

}  // namespace
}  // namespace raydix::test
