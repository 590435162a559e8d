#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/math.h"
#include "samples.h"

namespace raydix::test {
namespace {

/// A document over the external quad with these nodes and primitives.
std::string document(const std::string& nodes, const std::string& primitives,
                     const std::string& more = "") {
    return R"({"asset":{"version":"2.0"},"nodes":[)" + nodes + R"(],"meshes":[{"primitives":[)" +
           primitives + "]}]," + more +
           R"("accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},)"
           R"({"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}],)"
           R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":6}],)"
           R"("buffers":[{"uri":"quad.bin","byteLength":54}]})";
}
const std::string quad_primitive = R"({"attributes":{"POSITION":0},"indices":1})";

Mesh load_document(const std::string& text) { return load(load_gltf_sample, text); }
std::string gltf_error(const std::string& text) { return error_of(load_gltf_sample, text); }

TEST(Gltf, transforms_down_the_tree) {
    const Mesh mesh = load_document(document(
        R"({"children":[1],"translation":[10,0,0]},{"mesh":0,"scale":[2,1,1],"rotation":[0,0,0.7071067811865476,0.7071067811865476]})",
        quad_primitive));
    ASSERT_EQ(mesh.vertices.size(), 4u);
    EXPECT_NEAR(mesh.vertices[1].x, 10.0f,
                1e-5f);  // (1,0,0) scaled to (2,0,0), turned to (0,2,0), moved
    EXPECT_NEAR(mesh.vertices[1].y, 2.0f, 1e-5f);
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Gltf, matrix_and_mirrored_winding) {
    const Mesh mesh = load_document(
        document(R"({"mesh":0,"matrix":[-1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1]})", quad_primitive));
    EXPECT_TRUE(mesh.vertices[1] == (Vec3{4, 6, 7}));
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 2, 1}, {0, 3, 2}}));
}

TEST(Gltf, modes) {
    const auto with_mode = [](int mode) {
        return document(R"({"mesh":0})",
                        fmt::format(R"({{"attributes":{{"POSITION":0}},"mode":{}}})", mode));
    };
    EXPECT_EQ(load_document(with_mode(5)).triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 3, 2}}));
    EXPECT_EQ(load_document(with_mode(6)).triangles, (std::vector<Triangle>{{1, 2, 0}, {2, 3, 0}}));
    EXPECT_EQ(load_document(with_mode(0)).vertices.size(), 4u);
    EXPECT_TRUE(load_document(with_mode(0)).triangles.empty());
    EXPECT_TRUE(load_document(with_mode(1)).vertices.empty());
    EXPECT_EQ(gltf_error(with_mode(4)), "sample: meshes 0: 4 indices are not whole triangles");
    EXPECT_EQ(gltf_error(with_mode(7)), "sample: meshes 0: mode 7 is unknown");
}

TEST(Gltf, meshes_follow_each_other) {
    const Mesh mesh = load_document(document(R"({"mesh":0},{"mesh":0,"translation":[0,0,1]})",
                                             quad_primitive + "," + quad_primitive));
    EXPECT_EQ(mesh.vertices.size(), 16u);
    ASSERT_EQ(mesh.triangles.size(), 8u);
    EXPECT_EQ(mesh.triangles[2], (Triangle{4, 5, 6}));
    EXPECT_EQ(mesh.triangles[4], (Triangle{8, 9, 10}));
}

Model load_model_document(const std::string& text) {
    ByteSource in = ByteSource::from_memory(text, "sample");
    static const std::string external = gltf_buffer();
    return load_gltf(in, [](const std::filesystem::path&) {
        return ByteSource::from_memory(external, "external");
    });
}

TEST(Gltf, keeps_primitives_and_nodes) {
    const std::string lines = R"({"attributes":{"POSITION":0},"mode":1})";
    const Model model = load_model_document(
        R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[3,0]}],"nodes":[)"
        R"({"name":"a","children":[2,1],"translation":[1,2,3]},{"mesh":1},)"
        R"({"mesh":2,"scale":[2,2,2]},{"mesh":1},{"mesh":0}],"meshes":[{"primitives":[)" +
        quad_primitive + "]},{\"primitives\":[" + quad_primitive + "," + lines + "," +
        quad_primitive + "]},{\"primitives\":[" + quad_primitive +
        R"(]}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},)"
        R"({"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":6}],)"
        R"("buffers":[{"uri":"quad.bin","byteLength":54}]})");
    // Primitives count through, those of lines and of meshes that nobody shows included.
    ASSERT_EQ(model.meshes.size(), 5u);
    EXPECT_TRUE(model.meshes[0].triangles.empty());  // not shown, so not read
    EXPECT_EQ(model.meshes[1].triangles.size(), 2u);
    EXPECT_TRUE(model.meshes[2].vertices.empty());
    EXPECT_EQ(model.meshes[3].triangles.size(), 2u);
    EXPECT_EQ(model.meshes[4].triangles.size(), 2u);
    // 3; 0 and below it 2 and 1, as the lists have them.
    ASSERT_EQ(model.nodes.size(), 4u);
    const std::uint32_t parents[] = {ModelNode::none, ModelNode::none, 1, 1};
    const std::uint32_t first[] = {1, 0, 4, 1}, count[] = {3, 0, 1, 3};
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(model.nodes[k].parent, parents[k]);
        EXPECT_EQ(model.nodes[k].first_mesh, first[k]);
        EXPECT_EQ(model.nodes[k].mesh_count, count[k]);
    }
    EXPECT_EQ(model.nodes[1].name, "a");
    EXPECT_EQ(model.nodes[1].transform.m[2][3], 3.0);
    EXPECT_EQ(model.nodes[2].transform.m[1][1], 2.0);
}

TEST(Gltf, one_mesh_that_does_not_move_needs_no_node) {
    const Model plain = load_model_document(document(R"({"mesh":0})", quad_primitive));
    EXPECT_TRUE(plain.is_flat());
    EXPECT_EQ(plain.mesh().triangles.size(), 2u);
    for (const char* nodes : {R"({"mesh":0,"translation":[0,0,1]})", R"({"mesh":0},{"mesh":0})"})
        EXPECT_FALSE(load_model_document(document(nodes, quad_primitive)).is_flat());
    EXPECT_FALSE(
        load_model_document(document(R"({"mesh":0})", quad_primitive + "," + quad_primitive))
            .is_flat());
}

TEST(Gltf, primitives_that_share_positions_take_what_they_use) {
    // One triangle of the quad by three of its six indices, and all four vertices.
    const std::string three = R"({"attributes":{"POSITION":0},"indices":2})";
    std::string text = document(R"({"mesh":0})", three + "," + quad_primitive);
    const std::string more = R"({"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"})";
    const std::size_t at = text.find(more);
    text.insert(
        at + more.size(),
        R"(,{"bufferView":1,"byteOffset":3,"componentType":5121,"count":3,"type":"SCALAR"})");
    const Model model = load_model_document(text);
    ASSERT_EQ(model.meshes.size(), 2u);
    ASSERT_EQ(model.meshes[0].vertices.size(), 3u);
    EXPECT_EQ(model.meshes[0].triangles, (std::vector<Triangle>{{0, 1, 2}}));
    EXPECT_EQ(model.meshes[1].vertices.size(), 4u);
    // The second triangle of the quad is {0, 2, 3}.
    EXPECT_TRUE(model.meshes[0].vertices[1] == model.meshes[1].vertices[2]);
    EXPECT_TRUE(model.meshes[0].vertices[2] == model.meshes[1].vertices[3]);
}

TEST(Gltf, scene_choice) {
    const std::string nodes = R"({"mesh":0},{"mesh":0},{"mesh":0})";
    EXPECT_EQ(load_document(document(nodes, quad_primitive)).vertices.size(), 12u);
    EXPECT_EQ(load_document(
                  document(nodes, quad_primitive, R"("scenes":[{"nodes":[0]},{"nodes":[1,2]}],)"))
                  .vertices.size(),
              4u);
    EXPECT_EQ(load_document(document(nodes, quad_primitive,
                                     R"("scene":1,"scenes":[{"nodes":[0]},{"nodes":[1,2]}],)"))
                  .vertices.size(),
              8u);
}

TEST(Gltf, embedded_buffer) {
    EXPECT_EQ(
        load_document(
            R"({"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":12}],
        "buffers":[{"byteLength":12,"uri":"data:application/octet-stream;base64,AACAPwAAAEAAAEBA"}]})")
            .vertices.at(0)
            .z,
        3.0f);
}

TEST(Gltf, infinity_survives_the_identity) {
    std::string bytes = glb();
    const std::size_t x = bytes.find(std::string("BIN\0", 4)) + 4;
    bytes.replace(x, 4, raw(infinity));
    const Mesh mesh = load(load_gltf_sample, bytes);
    EXPECT_EQ(mesh.vertices[0].x, infinity);
    EXPECT_EQ(mesh.vertices[0].y, 0.0f);
}

TEST(Gltf, says_what_is_wrong) {
    const std::string node = R"({"mesh":0})";
    EXPECT_EQ(gltf_error("{"), "sample: JSON: not valid at byte 2");
    EXPECT_EQ(gltf_error("[]"), "sample: JSON: not an object");
    EXPECT_EQ(gltf_error(std::string(100'000, '[')), "sample: JSON: nested deeper than 64 levels");
    EXPECT_EQ(gltf_error(document(R"({"mesh":3})", quad_primitive)),
              "sample: meshes 3: there are only 1");
    EXPECT_EQ(gltf_error(document(R"({"mesh":-1})", quad_primitive)),
              "sample: nodes 0: mesh is not an integer from 0 to 2^53");
    EXPECT_EQ(gltf_error(document(R"({"children":[1]},{"children":[2]},{"children":[1]})",
                                  quad_primitive)),
              "sample: nodes 1: is reached twice");
    EXPECT_EQ(gltf_error(document(node, R"({"attributes":{"POSITION":1}})")),
              "sample: accessors 1: its type is not VEC3");
    EXPECT_EQ(gltf_error(document(node, R"({"attributes":{"POSITION":0},"indices":0})")),
              "sample: accessors 0: its type is not SCALAR");
    EXPECT_EQ(gltf_error(document(R"({"mesh":0,"scale":[1,2]})", quad_primitive)),
              "sample: nodes 0: scale is not a list of 3 numbers");
    EXPECT_EQ(gltf_error(document(node, quad_primitive,
                                  R"("extensionsRequired":["KHR_draco_mesh_compression"],)")),
              "sample: extensionsRequired: KHR_draco_mesh_compression is not read");

    const auto changed = [&](const std::string& from, const std::string& to) {
        std::string text = document(node, quad_primitive);
        text.replace(text.find(from), from.size(), to);
        return gltf_error(text);
    };
    EXPECT_EQ(changed("\"count\":4", "\"count\":5"),
              "sample: accessors 0: 5 elements do not fit into its bufferView");
    EXPECT_EQ(changed("\"count\":4", "\"count\":9007199254740992"),
              "sample: accessors 0: 9007199254740992 elements do not fit into its bufferView");
    EXPECT_EQ(changed("\"count\":4", "\"count\":4,\"sparse\":{}"),
              "sample: accessors 0: sparse accessors are not read");
    EXPECT_EQ(changed("\"count\":4", "\"count\":2"), "sample: meshes 0: index 2 of 2 vertices");
    EXPECT_EQ(changed("\"byteLength\":48", "\"byteLength\":55"),
              "sample: bufferViews 0: reaches beyond the end of its buffer");
    EXPECT_EQ(changed("\"byteLength\":54", "\"byteLength\":55"),
              "sample: buffers 0: holds 54 of 55 bytes");
    EXPECT_EQ(changed("quad.bin", "../quad.bin"),
              "sample: buffers 0: \"../quad.bin\" is not a file beside this one or below");
    EXPECT_EQ(changed("quad.bin", "%2Fetc%2Fpasswd"),
              "sample: buffers 0: \"%2Fetc%2Fpasswd\" is not a file beside this one or below");
    EXPECT_EQ(changed("quad.bin", "data:;base64,A*"), "sample: buffers 0: its data is not base64");
    EXPECT_EQ(changed("5121", "5130"), "sample: accessors 1: componentType 5130 is not read");
}

TEST(Gltf, copies_stay_in_proportion) {
    std::string positions, nodes = R"({"mesh":0})", scene = "0";
    for (int i = 0; i < 20'000; ++i) positions += "AACAPwAAAEAAAEBA";
    for (int i = 1; i < 4'000; ++i) {
        nodes += R"(,{"mesh":0})";
        scene += fmt::format(",{}", i);
    }
    const std::string text =
        R"({"scenes":[{"nodes":[)" + scene + R"(]}],"nodes":[)" + nodes +
        R"(],"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":20000,"type":"VEC3"}],)"
        R"("bufferViews":[{"buffer":0,"byteLength":240000}],"buffers":[{"byteLength":240000,"uri":"data:;base64,)" +
        positions + "\"}]}";
    EXPECT_EQ(gltf_error(text),
              "sample: as one mesh: its copies take more than 1000 times the memory of the meshes");
}

}  // namespace
}  // namespace raydix::test
