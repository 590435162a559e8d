// .rdx files of scenes: a loaded scene has the hits of the one that was saved, shares its pages,
// and goes on as a scene; what was cut, altered or made up is refused with one clear line.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/rdx.h>
#include <raydix/surface.h>

#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>

#include "api/rdx_parse.h"
#include "api/rdx_scene_format.h"
#include "engine/scene_state.h"
#include "instances/affine.h"
#include "support/message.h"
#include "support/random.h"
#include "support/rdx_seal.h"
#include "support/support.h"

namespace raydix::test {
namespace {

using Bytes = std::vector<std::byte>;

class Dice : public Random {
public:
    using Random::Random;
    Transform transform(float reach) {
        Transform t;
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            row[3] = between(-reach, reach);
        }
        return inverse_of(affine_of(t)) ? t : transform(reach);
    }
    std::uint32_t mask() { return below(3) == 0 ? 1u << below(3) : 0xFFFFFFFFu; }
};

Mesh random_mesh(Dice& dice) {
    Mesh mesh = random_soup(1 + dice.below(60), dice.below(1000), 0.6f);
    if (dice.below(3) == 0) mesh.vertices.front() = {-0.0f, 0.5f, -0.0f};
    if (dice.below(4) == 0) mesh.vertices.back().y = std::numeric_limits<float>::quiet_NaN();
    if (dice.below(4) == 0) mesh.triangles.front() = {0, 0, 1};
    return mesh;
}

/// Meshes, empty ones, holes, and two further scenes at several places each.
Scene random_scene(Dice& dice, std::uint32_t levels, const SceneOptions& options) {
    Scene scene;
    std::vector<Scene> inner;
    if (levels > 0)
        for (int k = 0; k < 2; ++k) inner.push_back(random_scene(dice, levels - 1, options));
    for (std::uint32_t k = 0, id = 0; k < 7; ++k, ++id) {
        if (dice.below(4) == 0) id += 1 + static_cast<std::uint32_t>(dice.below(5));
        const GeometryOptions geometry{dice.mask(), id};
        if (!inner.empty() && dice.below(3) != 0)
            scene.add(inner[dice.below(2)], dice.transform(3), geometry);
        else
            scene.add(dice.below(8) == 0 ? Mesh{} : random_mesh(dice), geometry);
    }
    scene.commit(options);
    return scene;
}

std::vector<Ray> random_rays(Dice& dice, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = dice.in(-5, 5), to = dice.in(-1, 1.5f);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
    }
    return rays;
}

bool same_hits(std::span<const Hit> a, std::span<const Hit> b) {
    const auto same = [](const Hit& x, const Hit& y) {
        return std::memcmp(&x.t, &y.t, sizeof(float)) == 0 && x.prim == y.prim && x.u == y.u &&
               x.v == y.v && x.geometry == y.geometry && x.instance == y.instance;
    };
    return std::ranges::equal(a, b, same);
}

std::size_t hits_in(std::span<const Hit> hits) {
    return static_cast<std::size_t>(std::ranges::count_if(hits, &Hit::hit));
}

bool same_points(std::span<const Vec3> a, std::span<const Vec3> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

/// Every answer that a scene gives.
void expect_same(const Scene& loaded, const Scene& saved, Dice& dice,
                 std::size_t* found = nullptr) {
    const std::vector<Ray> rays = random_rays(dice, 300);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(dice.mask());
    const std::vector<Hit> expected = trace(saved, rays, {.masks = masks});
    const std::vector<Hit> hits = trace(loaded, rays, {.masks = masks});
    EXPECT_TRUE(same_hits(hits, expected));
    if (found != nullptr) *found += hits_in(expected);
    std::vector<std::uint8_t> expected_any(rays.size()), any(rays.size());
    trace_any(saved, rays, expected_any);
    trace_any(loaded, rays, any);
    EXPECT_EQ(any, expected_any);
    const AllHits expected_all = trace_all(saved, rays), all = trace_all(loaded, rays);
    EXPECT_EQ(all.offsets, expected_all.offsets);
    EXPECT_TRUE(same_hits(all.hits, expected_all.hits));
    EXPECT_TRUE(same_points(positions(loaded, hits), positions(saved, expected)));
    EXPECT_TRUE(same_points(normals(loaded, hits), normals(saved, expected)));
    for (const Hit& hit : expected)
        if (hit.hit()) {
            EXPECT_EQ(loaded.path(hit.instance), saved.path(hit.instance));
        }
    EXPECT_EQ(loaded.size(), saved.size());
    const Aabb bounds = loaded.bounds(), expected_bounds = saved.bounds();
    EXPECT_EQ(std::memcmp(&bounds, &expected_bounds, sizeof(Aabb)), 0);
}

Bytes read_bytes(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    Bytes bytes(std::filesystem::file_size(file));
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

/// What the reader says to these bytes; "" if it takes them. Rays go through what it took.
std::string verdict(std::span<const std::byte> bytes) {
    const std::shared_ptr<void> owner = allocate_bytes(bytes.size());
    const std::span<std::byte> copy(static_cast<std::byte*>(owner.get()), bytes.size());
    if (!bytes.empty()) std::memcpy(copy.data(), bytes.data(), bytes.size());
    try {
        const RdxScene file = rdx::parse_scene("x.rdx", copy, owner);
        Dice dice(1);
        const std::vector<Hit> hits = trace(file.scene, random_rays(dice, 20), {.threads = 1});
        static_cast<void>(positions(file.scene, hits, 1));
        return "";
    } catch (const InputError& error) {
        return error.what();
    }
}

std::vector<rdx::Section> table_of(std::span<const std::byte> bytes) {
    std::vector<rdx::Section> table(rdx::scene_section_count);
    std::memcpy(table.data(), bytes.data() + sizeof(rdx::HeaderStart),
                table.size() * sizeof(rdx::Section));
    return table;
}

constexpr std::size_t header_bytes =
    sizeof(rdx::HeaderStart) + rdx::scene_section_count * sizeof(rdx::Section);

class RdxSceneTest : public ::testing::Test {
protected:
    [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "scene.rdx"; }
    Bytes saved(const Scene& scene) {
        save_rdx(file(), scene, "a scene", cameras_);
        return read_bytes(file());
    }

    TempFolder folder_;
    const CameraSet cameras_{
        640, 480, 0.5f, {{"front \xff", {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 30}, {}}};
};

TEST_F(RdxSceneTest, LoadedScenesHaveTheSameHits) {
    std::size_t found = 0;
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const Usage usage : {Usage::fixed, Usage::moving})
            for (const bool compact : {false, true})
                for (std::uint32_t levels = 0; levels < 4; ++levels) {
                    Dice dice(levels + 10 * static_cast<std::uint64_t>(quality));
                    const SceneOptions options{
                        .quality = quality, .usage = usage, .compact = compact};
                    const Scene scene = random_scene(dice, levels, options);
                    save_rdx(file(), scene, "a scene", cameras_);
                    EXPECT_TRUE(holds_scene(file()));
                    const RdxScene loaded = load_rdx_scene(file());
                    EXPECT_TRUE(loaded.scene.committed());
                    EXPECT_EQ(loaded.name, "a scene");
                    ASSERT_EQ(loaded.cameras.cameras.size(), 2u);
                    EXPECT_EQ(loaded.cameras.cameras[0].name, "front \xff");
                    EXPECT_EQ(loaded.cameras.cameras[0].vfov, 30.0f);
                    EXPECT_EQ(loaded.cameras.height, 480u);
                    EXPECT_EQ(loaded.cameras.ao_radius, 0.5f);
                    expect_same(loaded.scene, scene, dice, &found);
                    // Nothing is lost on the way back.
                    const Bytes once = read_bytes(file());
                    save_rdx(file(), loaded.scene, loaded.name, loaded.cameras);
                    EXPECT_EQ(read_bytes(file()), once);
                }
    EXPECT_GT(found, 2000u);
}

TEST_F(RdxSceneTest, SmallScenes) {
    const auto round_trip = [&](const Scene& scene) {
        Dice dice(3);
        save_rdx(file(), scene);
        expect_same(load_rdx_scene(file()).scene, scene, dice);
    };
    Scene empty;
    empty.commit();
    round_trip(empty);
    Scene shows_nothing;
    shows_nothing.add(empty, {}, {.mask = 5, .id = 9});
    shows_nothing.add(Mesh{}, {.mask = 3, .id = {}});
    shows_nothing.commit();
    round_trip(shows_nothing);
    Mesh flat;  // triangles, but none that rays hit
    flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    flat.triangles = {{0, 1, 2}, {0, 0, 1}};
    for (const bool compact : {false, true}) {
        round_trip(Scene(flat, {.compact = compact}));
        round_trip(Scene(random_soup(1, 4), {.compact = compact}));
        round_trip(Scene(random_soup(2, 5), {.compact = compact}));
    }
    Mesh huge = random_soup(20, 6);
    for (Vec3& v : huge.vertices) v = {v.x * 1e12f, v.y * 1e12f, v.z * 1e12f};
    for (const bool compact : {false, true}) round_trip(Scene(huge, {.compact = compact}));
}

TEST_F(RdxSceneTest, LargerMeshesOfAllQualities) {
    // Long thin triangles, of which quality high makes parts.
    Mesh mesh = random_soup(6000, 12, 0.02f);
    Dice dice(7);
    for (std::size_t i = 0; i < mesh.vertices.size(); i += 60) mesh.vertices[i] = dice.in(-2, 2);
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const bool compact : {false, true}) {
            const Scene scene(mesh, {.quality = quality, .compact = compact});
            save_rdx(file(), scene);
            expect_same(load_rdx_scene(file()).scene, scene, dice);
        }
}

TEST_F(RdxSceneTest, TreesAndMeshesLieInTheFile) {
    Scene object(random_soup(500, 3)), scene;
    for (int k = 0; k < 40; ++k) {
        Transform at;
        at.m[0][3] = static_cast<float>(k);
        scene.add(object, at);
    }
    scene.commit();
    const std::uint64_t bytes = saved(scene).size();
    EXPECT_LT(bytes, 500 * (36 + 12 + 60 + 40)) << "the scene inside is there once";
    const RdxScene loaded = load_rdx_scene(file());
    const SceneTree& tree = *SceneAccess::tree(loaded.scene);
    const SceneTree& inner = *tree.instances.front().scene;
    for (const InstanceName& instance : tree.instances)
        EXPECT_EQ(instance.scene.get(), &inner) << "and is one scene when it is loaded";
    const WideBvh::Arrays& arrays = inner.meshes.front()->tree->arrays();
    const auto* const first = reinterpret_cast<const std::byte*>(arrays.nodes.data());
    const auto lies_in_file = [&](const void* p) {
        const auto* const at = static_cast<const std::byte*>(p);
        return at >= first - bytes && at < first + bytes;
    };
    EXPECT_EQ(arrays.nodes.capacity_bytes() + arrays.blocks.capacity_bytes(), 0u);
    EXPECT_TRUE(lies_in_file(arrays.blocks.data()));
    EXPECT_TRUE(lies_in_file(inner.mesh_names.front().mesh.vertices.data()));
    EXPECT_TRUE(lies_in_file(inner.mesh_names.front().mesh.triangles.data()));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % 64, 0u);
}

TEST_F(RdxSceneTest, LoadedScenesGoOnAsScenes) {
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
        Dice dice(seed);
        const SceneOptions options{.usage = seed % 2 == 0 ? Usage::moving : Usage::fixed};
        Scene scene = random_scene(dice, 1 + static_cast<std::uint32_t>(seed % 2), options);
        scene.add(random_mesh(dice), {.mask = ~0u, .id = 1000});
        scene.remove(1000);
        scene.commit(options);
        static_cast<void>(saved(scene));
        Scene loaded = load_rdx_scene(file()).scene;
        EXPECT_EQ(loaded.commit(options).trees_built, 0u) << "a commit keeps the trees of the file";
        EXPECT_THROW(loaded.add(Mesh{}, {.mask = 1, .id = 1000}), InputError) << "given before";
        const Mesh other = random_mesh(dice);
        const Transform transform = dice.transform(2);
        for (Scene* const each : {&scene, &loaded}) {
            const std::uint32_t id = each->add(other);
            each->set_mask(id, 6);
            for (std::uint32_t k = 0; k < 40; ++k) {
                if (!each->contains(k)) continue;
                try {
                    each->set_transform(k, transform);
                } catch (const InputError&) {
                    k % 2 == 0 ? each->update(k, other) : each->remove(k);
                }
            }
            each->commit(options);
        }
        expect_same(loaded, scene, dice);
    }
}

TEST_F(RdxSceneTest, AMovedMeshOfALoadedSceneIsRefitted) {
    Mesh mesh = random_soup(300, 8);
    Scene scene;
    const SceneOptions moving{.usage = Usage::moving};
    scene.add(mesh);
    scene.commit(moving);
    static_cast<void>(saved(scene));
    Scene loaded = load_rdx_scene(file()).scene;
    for (Vec3& v : mesh.vertices) v.x += 0.01f * v.y;
    loaded.update(0, mesh);
    scene.update(0, mesh);
    EXPECT_EQ(scene.commit(moving).trees_refitted, 1u);
    EXPECT_EQ(loaded.commit(moving).trees_refitted, 1u);
    Dice dice(2);
    expect_same(loaded, scene, dice);
    static_cast<void>(saved(loaded));
    expect_same(load_rdx_scene(file()).scene, scene, dice);
}

TEST_F(RdxSceneTest, OutlivesTheFileAndTheLoadedScene) {
    Dice dice(5);
    const Scene scene = random_scene(dice, 1, {});
    static_cast<void>(saved(scene));
    Scene outer;
    {
        const RdxScene loaded = load_rdx_scene(file());
        std::filesystem::remove(file());
        outer.add(loaded.scene, Transform{});
    }
    outer.commit();
    Scene expected;
    expected.add(scene, Transform{});
    expected.commit();
    expect_same(outer, expected, dice);
}

TEST_F(RdxSceneTest, InstancesThatWouldComeToTooManyParts) {
    // 13 scenes of two instances of the one before: 8,192 parts of 832 bytes.
    std::vector<Scene> scenes;
    scenes.emplace_back(random_soup(3, 1));
    for (int level = 0; level < 13; ++level) {
        Scene next;
        for (int k = 0; k < 2; ++k) {
            Transform at;
            at.m[level % 3][3] = static_cast<float>(k << (level / 3));
            next.add(scenes.back(), at);
        }
        next.commit();
        scenes.push_back(std::move(next));
    }
    // Many such, each of its own.
    Scene whole;
    for (int k = 0; k < 16; ++k) {
        Scene twice;
        twice.add(scenes.back(), Transform{});
        twice.add(scenes.back(), Transform{});
        twice.commit();
        whole.add(twice, Transform{});
    }
    whole.commit();
    EXPECT_LT(saved(whole).size(), 20000u);
    const RdxScene loaded = load_rdx_scene(file());
    std::size_t placed = 0;
    const SceneTree& tree = *SceneAccess::tree(loaded.scene);
    for (const InstanceName& instance : tree.instances) placed += instance.scene->placed.size();
    EXPECT_LT(placed, 200000u);
    const std::vector<Ray> rays(8, Ray{{0.5f, 0.5f, -4}, 0, {0.01f, 0, 1}});
    EXPECT_TRUE(same_hits(trace(loaded.scene, rays), trace(whole, rays)));
}

TEST_F(RdxSceneTest, WhatCannotBeSaved) {
    Scene scene;
    const auto message = [&](const Scene& of, const CameraSet& cameras = {}) {
        return message_of([&] { save_rdx(file(), of, "", cameras); });
    };
    const std::string start = file().string() + ": not written: ";
    EXPECT_EQ(message(scene), start + "scene: it was never committed");
    Mesh mesh = random_soup(5, 2);
    scene.share(mesh);
    scene.commit();
    EXPECT_EQ(message(scene), "no error");
    mesh.vertices[0].x += 1;
    EXPECT_EQ(message(scene), start +
                                  "blocks: a leaf of node 0 holds what is no triangle of the "
                                  "meshes, or one that rays cannot hit");
    mesh.vertices[0].x -= 1;
    CameraSet bad = cameras_;
    bad.width = 0;
    EXPECT_EQ(message(scene, bad), start + "info: a picture of 0 x 480; sides are 1 to 65536");
    scene.set_mask(0, 1);
    EXPECT_EQ(message(scene), start + "scenes: it has changes that no commit has taken in");
}

TEST_F(RdxSceneTest, TheOtherKindIsNamed) {
    const Model model{.name = "", .meshes = {random_soup(5, 1)}, .nodes = {}, .cameras = {}};
    save_rdx(file(), build_bvh(model.mesh()), model);
    EXPECT_FALSE(holds_scene(file()));
    EXPECT_EQ(message_of([&] { static_cast<void>(load_rdx_scene(file())); }),
              file().string() + ": header: this file holds a tree, not a scene (load_rdx)");
    static_cast<void>(saved(Scene(model.mesh())));
    EXPECT_EQ(message_of([&] { static_cast<void>(load_rdx(file())); }),
              file().string() + ": header: this file holds a scene, not a tree (load_rdx_scene)");
}

/// Two scenes, an instance, plain trees; or compact ones.
Scene sample(bool compact) {
    Scene inner(random_soup(40, 2), {.compact = compact}), scene;
    scene.add(random_soup(30, 3));
    scene.add(inner, Transform{}, {.mask = 7, .id = 4});
    scene.add(inner, Transform{}, {.mask = 7, .id = 6});
    scene.commit({.compact = compact});
    return scene;
}

TEST_F(RdxSceneTest, EveryTruncationIsRefused) {
    const Bytes whole = saved(sample(false));
    ASSERT_EQ(verdict(whole), "");
    std::vector<std::size_t> cuts{0, 1, 8, 63, header_bytes - 1, header_bytes, whole.size() - 1};
    for (const rdx::Section& s : table_of(whole)) {
        const std::size_t end = s.offset + s.count * s.element_bytes;
        for (const std::size_t cut : {s.offset - 1, s.offset, s.offset + 1, end - 1, end})
            cuts.push_back(cut);
    }
    for (const std::size_t cut : cuts) {
        if (cut >= whole.size()) continue;
        const std::span<const std::byte> part(whole.data(), cut);
        EXPECT_NE(verdict(part).find("header: "), std::string::npos) << cut;
        if (cut < sizeof(rdx::HeaderStart)) continue;
        Bytes lying(part.begin(), part.end());
        seal_rdx(lying);
        EXPECT_NE(verdict(lying), "") << cut;
    }
}

TEST_F(RdxSceneTest, EveryByteIsGuarded) {
    const Bytes whole = saved(Scene(random_soup(3, 2)));
    Dice dice(5);
    for (std::size_t i = 0; i < whole.size(); ++i) {
        Bytes altered = whole;
        altered[i] ^= std::byte{static_cast<unsigned char>(1 + dice.below(255))};
        EXPECT_NE(verdict(altered), "") << "byte " << i;
    }
}

TEST_F(RdxSceneTest, FlipsUnderRightChecksumsAreSurvived) {
    for (const bool compact : {false, true}) {
        const Bytes whole = saved(sample(compact));
        Dice dice(6);
        std::size_t refused = 0;
        for (std::size_t round = 0; round < 1500 * thorough; ++round) {
            Bytes altered = whole;
            for (std::uint64_t k = 0; k <= dice.below(3); ++k)
                altered[dice.below(altered.size())] =
                    std::byte{static_cast<unsigned char>(dice.below(256))};
            seal_rdx(altered);
            refused += verdict(altered).empty() ? 0 : 1;
        }
        EXPECT_GT(refused, 500 * thorough);
    }
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

struct Lie {
    const char* told;
    std::function<void(Liar&)> change;
};

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
         [](Liar& l) { l.at<StoredGeometry>(rdx::scene_geometries, 2).is_instance = 2; }},
        {"x.rdx: geometries: scene 1: geometry 0 is a mesh with a transform",
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

TEST_F(RdxSceneTest, LiesUnderRightChecksumsAreNamed) {
    const Bytes plain = saved(sample(false)), compact = saved(sample(true));
    const auto expect_told = [](const Bytes& whole, const std::vector<Lie>& group) {
        for (const Lie& lie : group) {
            Liar liar(whole);
            ASSERT_EQ(liar.told(), "");
            lie.change(liar);
            const std::string told = liar.told();
            EXPECT_EQ(told.rfind(lie.told, 0), 0u)
                << "expected " << lie.told << "\n     got " << told;
            EXPECT_EQ(told.find('\n'), std::string::npos);
        }
    };
    expect_told(plain, lies());
    expect_told(compact, lies());
    expect_told(plain, lies_of_plain_trees());
    expect_told(compact, lies_of_compact_trees());
}

}  // namespace
}  // namespace raydix::test
