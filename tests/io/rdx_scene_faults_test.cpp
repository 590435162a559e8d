// .rdx files of scenes that were cut, altered or made up are refused with one clear line.
#include <gtest/gtest.h>
#include <raydix/shapes.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "io/rdx_scenes.h"

namespace raydix::test {
namespace {

class RdxSceneFaults : public RdxSceneTest {};

/// Two scenes, an instance, plain trees; or compact ones.
Scene sample(bool compact) {
    Scene inner(random_soup(40, 2), {.compact = compact}), scene;
    scene.add(random_soup(30, 3));
    scene.add(inner, Transform{}, {.mask = 7, .id = 4});
    scene.add(inner, Transform{}, {.mask = 7, .id = 6});
    scene.commit({.compact = compact});
    return scene;
}

/// All kinds of shapes, some of them beside a mesh and an instance.
Scene sample_of_shapes() {
    Scene inner, scene;
    inner.add(std::vector<Sphere>{{{0, 0, 0}, 1}, {{2, 0, 0}, 0.5f}});
    inner.commit();
    scene.add(random_soup(30, 3));
    scene.add(std::vector<Capsule>{{{0, 0, 0}, {1, 1, 0}, 0.25f}});
    scene.add(std::vector<Vec3>{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 0.125f);
    scene.add(inner, Transform{});
    scene.commit();
    return scene;
}

TEST_F(RdxSceneFaults, EveryTruncationIsRefused) {
    for (const Bytes& whole : {saved(sample(false)), saved(sample_of_shapes())})
        expect_cuts_refused(whole, header_bytes_of(whole), sizeof(rdx::HeaderStart),
                            table_of(whole), verdict);
}

TEST_F(RdxSceneFaults, EveryByteIsGuarded) {
    expect_every_byte_guarded(saved(Scene(random_soup(3, 2))), verdict);
    Scene shapes;
    shapes.add(std::vector<Vec3>{{1, 0, 0}}, 0.5f);
    shapes.commit();
    expect_every_byte_guarded(saved(shapes), verdict);
}

TEST_F(RdxSceneFaults, FlipsUnderRightChecksumsAreSurvived) {
    for (const bool compact : {false, true})
        EXPECT_GT(refused_after_flips(saved(sample(compact)), 1500 * thorough, verdict),
                  500 * thorough);
    EXPECT_GT(refused_after_flips(saved(sample_of_shapes()), 1500 * thorough, verdict),
              300 * thorough);
}

/// A file after a change, with right checksums.
class Liar {
public:
    explicit Liar(Bytes bytes) : bytes_(std::move(bytes)) {}

    template <class T>
    T& at(rdx::SceneSectionId id, std::size_t i) {
        return reinterpret_cast<T*>(bytes_.data() + table_of(bytes_)[id].offset)[i];
    }
    rdx::Section& section(rdx::SceneSectionId id) {
        return reinterpret_cast<rdx::Section*>(bytes_.data() + sizeof(rdx::HeaderStart))[id];
    }
    std::string told() {
        seal_rdx(bytes_);
        return verdict(bytes_);
    }

private:
    Bytes bytes_;
};

using Lie = LieOf<Liar>;

/// The first slot of a node that holds a leaf, or an inner node.
template <class Node>
std::size_t slot_of(const Node& node, bool leaf) {
    for (std::size_t s = 0; s < 8; ++s)
        if (node.child[s] != wide_no_child && ((node.child[s] & wide_leaf_bit) != 0) == leaf)
            return s;
    ADD_FAILURE() << "no such slot";
    return 0;
}

template <class Node>
std::vector<Lie> lies_in_nodes(rdx::SceneSectionId nodes) {
    const auto child = [nodes](bool leaf, const std::function<void(std::uint32_t&)>& change) {
        return [=](Liar& l) {
            Node& node = l.at<Node>(nodes, 0);
            change(node.child[slot_of(node, leaf)]);
        };
    };
    return {
        {"x.rdx: nodes: node 0 has node 0 of", child(false, [](auto& word) { word = 0; })},
        {"x.rdx: nodes: node 0 has node 1000000 of",
         child(false, [](auto& word) { word = 1000000; })},
        {"x.rdx: nodes: node ", child(false, [](auto& word) { ++word; })},
        {"x.rdx: nodes: node 0 has ", child(false, [](auto& word) { word = wide_no_child; })},
    };
}

std::vector<Lie> lies() {
    return {
        {"x.rdx: info: the reserved bytes",
         [](Liar& l) { l.at<rdx::SceneInfo>(rdx::scene_info, 0).reserved = 1; }},
        {"x.rdx: info: a picture of 640 x 0",
         [](Liar& l) { l.at<rdx::SceneInfo>(rdx::scene_info, 0).picture_height = 0; }},
        {"x.rdx: info: the next id is 4294967296",
         [](Liar& l) {
             l.at<rdx::SceneInfo>(rdx::scene_info, 0).next_id = std::uint64_t{1} << 32;
         }},
        {"x.rdx: names: a name of 4294967295",
         [](Liar& l) { l.at<rdx::SceneInfo>(rdx::scene_info, 0).name_bytes = 0xFFFFFFFFu; }},
        {"x.rdx: geometries: scene 0 has 4294967295, but 4 are left",
         [](Liar& l) { l.at<StoredScene>(rdx::scene_scenes, 0).geometry_count = 0xFFFFFFFFu; }},
        {"x.rdx: geometries: scene 0 has the id 0, which does not follow",
         [](Liar& l) { l.at<StoredScene>(rdx::scene_scenes, 0).geometry_count = 4; }},
        {"x.rdx: scenes: scene 1 was made with unknown options",
         [](Liar& l) { l.at<StoredScene>(rdx::scene_scenes, 1).usage = 2; }},
        {"x.rdx: scenes: scene 1 was made with unknown options",
         [](Liar& l) { l.at<StoredScene>(rdx::scene_scenes, 1).quality = 3; }},
        {"x.rdx: trees: tree 1 is not of the kind that scene 1 has",
         [](Liar& l) { l.at<StoredScene>(rdx::scene_scenes, 1).compact ^= 1; }},
        {"x.rdx: geometries: scene 1: geometry 4 shows scene 1, which is not before it",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).number = 1; }},
        {"x.rdx: geometries: scene 1: geometry 4 shows scene 4294967295",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).number = 0xFFFFFFFFu; }},
        {"x.rdx: geometries: scene 1: instance 4: its transform is singular",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).transform.m = {}; }},
        {"x.rdx: geometries: scene 1: instance 4: its transform is singular",
         [](Liar& l) {
             l.at<StoredGeometry>(rdx::scene_geometries, 2).transform.m[1][3] = infinity;
         }},
        {"x.rdx: geometries: scene 1: instance 4: it reaches beyond 1e12",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).transform.m[1][3] = 3e12f; }},
        {"x.rdx: geometries: scene 1: geometry 4 is of an unknown kind",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).kind = 3; }},
        {"x.rdx: geometries: scene 1: geometry 0 is no instance, but has a transform",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 1).transform.m[0][0] = 1; }},
        {"x.rdx: geometries: scene 1: geometry 0 is mesh 2 of 2",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 1).number = 2; }},
        {"x.rdx: meshes: mesh 1 stands nowhere",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 1).number = stored_none; }},
        {"x.rdx: meshes: mesh 1 stands nowhere",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 1).number = 0; }},
        {"x.rdx: geometries: scene 1 has the id 4, which does not follow",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 3).id = 4; }},
        {"x.rdx: taken: id 9 was given, but is not among them",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 3).id = 9; }},
        {"x.rdx: taken: id 1 is out of order",
         [](Liar& l) { l.at<std::uint32_t>(rdx::scene_taken, 0) = 1; }},
        {"x.rdx: taken: id 3 is out of order",
         [](Liar& l) { l.at<std::uint32_t>(rdx::scene_taken, 1) = 3; }},
        {"x.rdx: vertices: mesh 0 has 18446744073709551615",
         [](Liar& l) { l.at<StoredMesh>(rdx::scene_meshes, 0).vertices = ~std::uint64_t{0}; }},
        {"x.rdx: vertices: 1 belong to nothing",
         [](Liar& l) { --l.at<StoredMesh>(rdx::scene_meshes, 1).vertices; }},
        {"x.rdx: meshes: mesh 0 has no triangles",
         [](Liar& l) {
             StoredMesh& first = l.at<StoredMesh>(rdx::scene_meshes, 0);
             l.at<StoredMesh>(rdx::scene_meshes, 1).triangles += first.triangles;
             first.triangles = 0;
         }},
        {"x.rdx: triangles: triangle 3 of mesh 0 has an index past the 120",
         [](Liar& l) { l.at<Triangle>(rdx::scene_triangles, 3)[1] = 120; }},
        {"x.rdx: blocks: ",  // another triangle than the leaf's, or none
         [](Liar& l) { l.at<Triangle>(rdx::scene_triangles, 3)[1] = 0; }},
        {"x.rdx: blocks: ",
         [](Liar& l) {
             l.at<Vec3>(rdx::scene_vertices, 7).x = std::numeric_limits<float>::quiet_NaN();
         }},
        {"x.rdx: meshes: tree 0 has 3, but 2 are left",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 0).meshes = 3; }},
        {"x.rdx: trees: tree 0 has no meshes",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 0).meshes = 0; }},
        {"x.rdx: trees: tree 0 is of an unknown kind",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 0).compact = 2; }},
        {"x.rdx: trees: tree 1 has figures that are negative or not finite",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 1).sah_at_build = -1; }},
        {"x.rdx: trees: bounds that are empty or out of range (tree 1)",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 1).bounds.hi.x = infinity; }},
        {"x.rdx: nodes: node 0 has a leaf with a triangle beside its box (tree 0)",
         [](Liar& l) {
             Aabb& bounds = l.at<StoredTree>(rdx::scene_trees, 0).bounds;
             bounds.hi = bounds.lo;
         }},
        {"x.rdx: cameras: camera 0 is not finite",
         [](Liar& l) { l.at<rdx::Camera>(rdx::scene_cameras, 0).up.y = infinity; }},
    };
}

std::vector<Lie> lies_of_plain_trees() {
    std::vector<Lie> out = lies_in_nodes<WideNode>(rdx::scene_nodes);
    const std::vector<Lie> more{
        {"x.rdx: nodes: tree 1 has 1099511627776, but",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 1).nodes = std::uint64_t{1} << 40; }},
        {"x.rdx: nodes: none, but there are blocks",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 0).nodes = 0; }},
        {"x.rdx: nodes: node 0 has no proper box in slot 0",
         [](Liar& l) { l.at<WideNode>(rdx::scene_nodes, 0).lo[1][0] = infinity; }},
        {"x.rdx: nodes: node 0 has no proper box in slot 0",
         [](Liar& l) {
             l.at<WideNode>(rdx::scene_nodes, 0).hi[2][0] = std::numeric_limits<float>::quiet_NaN();
         }},
        {"x.rdx: nodes: node 0 has a child that reaches beyond its box",
         [](Liar& l) {
             WideNode& node = l.at<WideNode>(rdx::scene_nodes, 0);
             const std::size_t s = slot_of(node, false);
             node.hi[0][s] = node.lo[0][s];
         }},
        {"x.rdx: nodes: node 1 has a leaf with a triangle beside its box",
         [](Liar& l) {
             WideNode& node = l.at<WideNode>(rdx::scene_nodes, 1);
             const std::size_t s = slot_of(node, true);
             node.lo[0][s] = node.hi[0][s];
         }},
        {"x.rdx: nodes: node 1 has a leaf of",
         [](Liar& l) {
             WideNode& node = l.at<WideNode>(rdx::scene_nodes, 1);
             node.child[slot_of(node, true)] = wide_leaf_bit | 0x7FFFFF0u;
         }},
        {"x.rdx: nodes: node 1 has a leaf of 8 triangles",
         [](Liar& l) {
             WideNode& node = l.at<WideNode>(rdx::scene_nodes, 1);
             node.child[slot_of(node, true)] |= 7;
         }},
        {"x.rdx: blocks: ",
         [](Liar& l) { l.at<TriangleBlock>(rdx::scene_blocks, 0).prim[0] = 0x80000000u; }},
        {"x.rdx: blocks: ",
         [](Liar& l) { l.at<TriangleBlock>(rdx::scene_blocks, 0).corner[4][0] += 1; }},
        {"x.rdx: blocks: ",
         [](Liar& l) {
             l.at<TriangleBlock>(rdx::scene_blocks, 0).corner[4][0] =
                 std::numeric_limits<float>::quiet_NaN();
         }},
    };
    out.insert(out.end(), more.begin(), more.end());
    return out;
}

std::vector<Lie> lies_of_compact_trees() {
    std::vector<Lie> out = lies_in_nodes<CompactNode>(rdx::scene_compact_nodes);
    const std::vector<Lie> more{
        {"x.rdx: compact_nodes: tree 1 has 1099511627776, but",
         [](Liar& l) { l.at<StoredTree>(rdx::scene_trees, 1).nodes = std::uint64_t{1} << 40; }},
        {"x.rdx: nodes: node 0 has no proper box in slot",
         [](Liar& l) { l.at<CompactNode>(rdx::scene_compact_nodes, 0).used ^= 1; }},
        {"x.rdx: nodes: node 0 has no proper box in slot 0",
         [](Liar& l) { l.at<CompactNode>(rdx::scene_compact_nodes, 0).exponent[2] = 255; }},
        {"x.rdx: nodes: node 0 has no proper box in slot 0",
         [](Liar& l) {
             l.at<CompactNode>(rdx::scene_compact_nodes, 0).origin[2] =
                 std::numeric_limits<float>::quiet_NaN();
         }},
        {"x.rdx: nodes: node 0 has a child that reaches beyond its box",
         [](Liar& l) {
             CompactNode& node = l.at<CompactNode>(rdx::scene_compact_nodes, 0);
             const std::size_t s = slot_of(node, false);
             node.hi[0][s] = node.lo[0][s];
         }},
        {"x.rdx: blocks: block 0 names a corner past the",
         [](Liar& l) {
             l.at<CompactBlock>(rdx::scene_compact_blocks, 0).vertex[2][3] = 0xFFFFFFFFu;
         }},
        {"x.rdx: blocks: ", [](Liar& l) { l.at<Vec3>(rdx::scene_corners, 0).y += 1; }},
        {"x.rdx: corners: one is not finite",
         [](Liar& l) { l.at<Vec3>(rdx::scene_corners, 0).y = infinity; }},
        {"x.rdx: corners: tree 1 has",
         [](Liar& l) { ++l.at<StoredTree>(rdx::scene_trees, 1).corners; }},
    };
    out.insert(out.end(), more.begin(), more.end());
    return out;
}

std::vector<Lie> lies_of_shapes() {
    return {
        {"x.rdx: shapes: shapes 0 are of an unknown kind",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 0).kind = 3; }},
        {"x.rdx: shapes: shapes 0 have a radius each, and one more",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 0).radius = 1; }},
        {"x.rdx: spheres: shapes 0 has 18446744073709551615, but 2 are left",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 0).count = ~std::uint64_t{0}; }},
        {"x.rdx: spheres: 1 belong to nothing",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 0).count = 1; }},
        {"x.rdx: spheres: shapes 1 has 1, but 0 are left",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 1).kind = 0; }},
        {"x.rdx: points: 1 belong to nothing",
         [](Liar& l) { l.at<StoredShapes>(rdx::scene_shapes, 2).count = 2; }},
        {"x.rdx: geometries: scene 1: geometry 1 is shapes 3 of 3",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).number = 3; }},
        {"x.rdx: geometries: scene 1: geometry 1 is shapes 0 once more",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).number = 0; }},
        {"x.rdx: geometries: scene 1: geometry 1 is no instance, but has a transform",
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).transform.m[0][0] = 1; }},
        {"x.rdx: shapes: shapes 1 stand nowhere",
         [](Liar& l) {
             StoredGeometry& geometry = l.at<StoredGeometry>(rdx::scene_geometries, 2);
             geometry.kind = stored_mesh;
             geometry.number = stored_none;
         }},
    };
}

TEST_F(RdxSceneFaults, LiesUnderRightChecksumsAreNamed) {
    const Bytes plain = saved(sample(false)), compact = saved(sample(true));
    expect_told(plain, lies());
    expect_told(compact, lies());
    expect_told(plain, lies_of_plain_trees());
    expect_told(compact, lies_of_compact_trees());
    expect_told(saved(sample_of_shapes()), lies_of_shapes());
}

}  // namespace
}  // namespace raydix::test
