// .rdx files: what is saved comes back; what was cut, altered or made up is refused with one clear
// line.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <functional>

#include "io/rdx_faults.h"
#include "io/rdx_parse.h"
#include "support/support.h"

namespace raydix::test {
namespace {

void write_bytes(const std::filesystem::path& file, std::span<const std::byte> bytes) {
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
}

std::size_t files_in(const std::filesystem::path& folder) {
    const std::filesystem::directory_iterator files(folder);
    return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

Model make_scene(std::size_t triangles) {
    Model scene;
    scene.name = "soup \xff.ply";  // names are bytes
    scene.mesh() = random_soup(triangles, 31);
    scene.cameras = {640, 480, 0.5f, {{"front", {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 30}, {}}};
    return scene;
}

Bytes saved(const TempFolder& folder, const Bvh& bvh, const Model& scene) {
    const auto file = folder.path() / "scene.rdx";
    save_rdx(file, bvh, scene);
    return read_bytes(file);
}

/// What the reader says to these bytes; "" if it takes them.
std::string verdict(std::span<const std::byte> bytes) {
    return verdict_of(bytes, [](std::span<std::byte> copy, const std::shared_ptr<void>& owner) {
        static_cast<void>(rdx::parse("x.rdx", copy, owner));
    });
}

rdx::Header header_of(std::span<const std::byte> bytes) {
    rdx::Header header;
    std::memcpy(&header, bytes.data(), sizeof(header));
    return header;
}

class Rdx : public ::testing::Test {
protected:
    TempFolder folder_;
};

TEST_F(Rdx, BytesDoNotDependOnTheThreads) {
    const Model scene = make_scene(3000 * thorough);
    for (const Builder builder :
         {Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
          Builder::hploc, Builder::binned}) {
        const auto bytes_with = [&](int threads) {
            return saved(folder_, build_bvh(scene.mesh(), {.builder = builder, .threads = threads}),
                         scene);
        };
        const Bytes one = bytes_with(1);
        for (const int threads : {2, 5})
            EXPECT_TRUE(bytes_with(threads) == one)
                << builder_name(builder) << ", " << threads << " threads";
    }
}

TEST_F(Rdx, RoundTripOfTriangles) {
    for (const std::size_t n : {0u, 1u, 2u, 3u, 5u, 4000u}) {
        Model scene = make_scene(n);
        if (n > 5) {
            scene.mesh().vertices[33].x = std::numeric_limits<float>::quiet_NaN();
            scene.mesh().vertices[66] = {-0.0f, 0.5f, -0.0f};
        }
        const Bvh bvh = build_bvh(scene.mesh(), {.bits = 30, .max_leaf = 3, .strict = false});
        save_rdx(folder_.path() / "a.rdx", bvh, scene);
        EXPECT_EQ(files_in(folder_.path()), 1u) << "no temporary file stays";
        const RdxFile loaded = load_rdx(folder_.path() / "a.rdx");

        EXPECT_EQ(check_same(loaded.bvh, bvh).broken, "");
        EXPECT_EQ(tree_hash(loaded.bvh), tree_hash(bvh));
        EXPECT_EQ(loaded.bvh.left_out(), bvh.left_out());
        EXPECT_EQ(loaded.bvh.peak_bytes(), 0u);
        EXPECT_EQ(loaded.scene.name, scene.name);
        EXPECT_EQ(loaded.scene.mesh().name, "soup");
        EXPECT_EQ(loaded.scene.mesh().triangles, scene.mesh().triangles);
        ASSERT_EQ(loaded.scene.mesh().vertices.size(), scene.mesh().vertices.size());
        if (n != 0) {
            EXPECT_EQ(std::memcmp(loaded.scene.mesh().vertices.data(), scene.mesh().vertices.data(),
                                  scene.mesh().vertices.size() * sizeof(Vec3)),
                      0)
                << "as given, NaN and -0 included";
        }
        ASSERT_EQ(loaded.scene.cameras.cameras.size(), 2u);
        EXPECT_EQ(loaded.scene.cameras.cameras[0].name, "front");
        EXPECT_EQ(loaded.scene.cameras.cameras[0].vfov, 30.0f);
        EXPECT_EQ(loaded.scene.cameras.cameras[0].position.z, 3.0f);
        EXPECT_EQ(loaded.scene.cameras.cameras[1].name, "");
        EXPECT_EQ(loaded.scene.cameras.width, 640u);
        EXPECT_EQ(loaded.scene.cameras.height, 480u);
        EXPECT_EQ(loaded.scene.cameras.ao_radius, 0.5f);
    }
}

TEST_F(Rdx, TracesOfALoadedTreeAreTheSame) {
    const Model scene = make_scene(3000);
    const Bvh bvh = build_bvh(scene.mesh());
    save_rdx(folder_.path() / "a.rdx", bvh, scene);
    const RdxFile loaded = load_rdx(folder_.path() / "a.rdx");
    std::mt19937_64 random(41);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::vector<Ray> rays;
    for (int i = 0; i < 2000; ++i)
        rays.push_back({{unit(), unit(), -1}, 0, {unit() - 0.5f, unit() - 0.5f, 1}, infinity});
    const std::vector<Hit> expected = trace(bvh, rays), hits = trace(loaded.bvh, rays);
    EXPECT_GT(std::ranges::count_if(expected, &Hit::hit), 100);
    EXPECT_EQ(std::memcmp(hits.data(), expected.data(), hits.size() * sizeof(Hit)), 0);
}

TEST_F(Rdx, RoundTripOfPointsAndBoxes) {
    Model cloud = make_scene(100);
    cloud.mesh().triangles.clear();
    cloud.mesh().vertices[7].y = infinity;
    const Bvh points = build_bvh(cloud.mesh());
    save_rdx(folder_.path() / "points.rdx", points, cloud);
    EXPECT_EQ(check_same(load_rdx(folder_.path() / "points.rdx").bvh, points).broken, "");

    const std::vector<Aabb> boxes{
        {{0, 0, 0}, {1, 1, 1}}, {{1, 1, 1}, {0, 0, 0}}, {{3, 0, 0}, {4, 1, 1}}};
    const Bvh of_boxes = build_bvh(boxes);
    save_rdx(folder_.path() / "boxes.rdx", of_boxes, Model{});
    const RdxFile loaded = load_rdx(folder_.path() / "boxes.rdx");
    EXPECT_EQ(check_same(loaded.bvh, of_boxes).broken, "");
    EXPECT_EQ(loaded.bvh.left_out(), 1u);
}

TEST_F(Rdx, ALoadedTreeCanBeRebuiltAndSavedOverItself) {
    const Model scene = make_scene(1000);
    const auto file = folder_.path() / "a.rdx";
    save_rdx(file, build_bvh(scene.mesh()), scene);
    RdxFile loaded = load_rdx(file);
    save_rdx(file, loaded.bvh, loaded.scene);
    EXPECT_EQ(check(loaded.bvh, loaded.scene.mesh()).broken, "") << "the old file is still mapped";
    BvhBuilder().build(loaded.scene.mesh(), {.max_leaf = 2},
                       loaded.bvh);  // must not write to the mapping
    EXPECT_EQ(check(loaded.bvh, loaded.scene.mesh()).broken, "");
    EXPECT_EQ(load_rdx(file).bvh.options().max_leaf, 4);
}

TEST_F(Rdx, FilesThatCannotBeRead) {
    const auto message = [&](const std::filesystem::path& file) -> std::string {
        try {
            static_cast<void>(load_rdx(file));
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    const auto missing = folder_.path() / "missing.rdx";
    EXPECT_EQ(message(missing),
              missing.string() + ": file: cannot be opened: No such file or directory");
    EXPECT_NE(message(folder_.path()).find("Is a directory"), std::string::npos);
    EXPECT_NE(message("/dev/null").find("not a regular file"), std::string::npos);
    write_bytes(folder_.path() / "empty.rdx", {});
    EXPECT_NE(message(folder_.path() / "empty.rdx").find("header: the file has 0 bytes"),
              std::string::npos);
    write_bytes(folder_.path() / "text.rdx", Bytes(5000, std::byte{'a'}));
    EXPECT_NE(message(folder_.path() / "text.rdx").find("header: this is no .rdx file"),
              std::string::npos);
}

TEST_F(Rdx, SavingThatFailsLeavesNothing) {
    const Model scene = make_scene(50);
    const Bvh bvh = build_bvh(scene.mesh());
    EXPECT_THROW(save_rdx(folder_.path() / "no" / "such.rdx", bvh, scene), InputError);
    std::filesystem::create_directory(folder_.path() / "taken.rdx");
    EXPECT_THROW(save_rdx(folder_.path() / "taken.rdx", bvh, scene), InputError);
    EXPECT_THROW(save_rdx(folder_.path() / "other.rdx", bvh, make_scene(51)), InputError);
    Model bad_camera = scene;
    bad_camera.cameras.cameras[0].vfov = 180;
    EXPECT_THROW(save_rdx(folder_.path() / "camera.rdx", bvh, bad_camera), InputError);
    EXPECT_EQ(files_in(folder_.path()), 1u);
}

TEST_F(Rdx, FullDiskLeavesTheOldFile) {
    const Model small = make_scene(10), large = make_scene(5000);
    const auto file = folder_.path() / "a.rdx";
    save_rdx(file, build_bvh(small.mesh()), small);
    const Bytes before = read_bytes(file);
    const Bvh bvh = build_bvh(large.mesh());
    rlimit old{};
    getrlimit(RLIMIT_FSIZE, &old);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit tight{100'000, old.rlim_max};
    setrlimit(RLIMIT_FSIZE, &tight);
    EXPECT_THROW(save_rdx(file, bvh, large), InputError);
    setrlimit(RLIMIT_FSIZE, &old);
    std::signal(SIGXFSZ, handler);
    EXPECT_EQ(read_bytes(file), before);
    EXPECT_EQ(files_in(folder_.path()), 1u);
}

TEST_F(Rdx, EveryTruncationIsRefused) {
    const Model scene = make_scene(60);
    const Bytes whole = saved(folder_, build_bvh(scene.mesh()), scene);
    expect_cuts_refused(whole, sizeof(rdx::Header), sizeof(rdx::Header), header_of(whole).sections,
                        verdict);
    Bytes longer = whole;
    longer.resize(longer.size() + 64);
    EXPECT_NE(verdict(longer).find("bytes promised"), std::string::npos);
    seal_rdx(longer);
    EXPECT_NE(verdict(longer).find("names: ends at byte"), std::string::npos) << verdict(longer);
}

TEST_F(Rdx, EveryByteIsGuarded) {
    const Model scene = make_scene(20);
    expect_every_byte_guarded(saved(folder_, build_bvh(scene.mesh()), scene), verdict);
}

TEST_F(Rdx, FlipsUnderRightChecksumsAreSurvived) {
    const Model scene = make_scene(40);
    const Bytes whole = saved(folder_, build_bvh(scene.mesh()), scene);
    const std::size_t rounds = 500 * thorough;
    // Names and cameras may be anything.
    EXPECT_GT(refused_after_flips(whole, rounds, verdict), rounds - 100 * thorough);
}

/// A file after `change` of the header or of one section, with right checksums.
class LiarOfTrees {
public:
    explicit LiarOfTrees(Bytes bytes) : bytes_(std::move(bytes)) {}

    template <class T>
    T* at(rdx::SectionId id, std::size_t i) {
        return reinterpret_cast<T*>(bytes_.data() + header_of(bytes_).sections[id].offset) + i;
    }
    void change_header(const std::function<void(rdx::Header&)>& change) {
        rdx::Header header = header_of(bytes_);
        change(header);
        std::memcpy(bytes_.data(), &header, sizeof(header));
    }
    std::string told() {
        seal_rdx(bytes_);
        return verdict(bytes_);
    }

private:
    Bytes bytes_;
};

using TreeLie = LieOf<LiarOfTrees>;

std::vector<TreeLie> lies_in_content() {
    return {
        {"x.rdx: nodes: inner node",  // the children of the root's left child are the root's
         [](LiarOfTrees& l) {
             l.at<BvhNode>(rdx::nodes, 2)->first = l.at<BvhNode>(rdx::nodes, 0)->first;
         }},
        {"x.rdx: nodes: inner node 0 has its children at slot 4294967294 of",
         [](LiarOfTrees& l) { l.at<BvhNode>(rdx::nodes, 0)->first = 0xFFFFFFFEu; }},
        {"x.rdx: nodes: leaf 0 holds 4294967295 primitives",
         [](LiarOfTrees& l) { l.at<BvhNode>(rdx::nodes, 0)->count = 0xFFFFFFFFu; }},
        {"x.rdx: nodes: the box of inner node 0",
         [](LiarOfTrees& l) { l.at<BvhNode>(rdx::nodes, 0)->hi.x = 1e12f; }},
        {"x.rdx: order: position 5 names primitive 4294967295 of 100",
         [](LiarOfTrees& l) { *l.at<std::uint32_t>(rdx::order, 5) = 0xFFFFFFFFu; }},
        {"x.rdx: order: primitive",
         [](LiarOfTrees& l) {
             *l.at<std::uint32_t>(rdx::order, 5) = *l.at<std::uint32_t>(rdx::order, 6);
         }},
        {"x.rdx: primitives: the one at position 3 belongs in no tree",
         [](LiarOfTrees& l) { l.at<LeafTriangle>(rdx::primitives, 3)->v0.x = std::nanf(""); }},
        {"x.rdx: primitives: the one at position",
         [](LiarOfTrees& l) { l.at<Vec3>(rdx::vertices, 9)->x += 1; }},
        {"x.rdx: triangles: triangle 7 has the vertices",
         [](LiarOfTrees& l) { (*l.at<Triangle>(rdx::triangles, 7))[2] = 300; }},
        {"x.rdx: info: depth 4294967295 claimed",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->max_depth = 0xFFFFFFFFu; }},
        {"x.rdx: nodes:",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->inner_count = 0xFFFFFFFFu; }},
        {"x.rdx: info: 1099511627776 primitives",
         [](LiarOfTrees& l) {
             l.at<rdx::Info>(rdx::info, 0)->input_count = std::uint64_t{1} << 40;
         }},
        {"x.rdx: info: primitive kind 3",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->kind = 3; }},
        {"x.rdx: primitives: elements of 36 bytes",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->kind = 1; }},
        {"x.rdx: info: flags are 4",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->flags = 4; }},
        {"x.rdx: info: builder number 10",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->builder = 10; }},
        {"x.rdx: info: -1 code bits",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->bits = 0xFFFFFFFFu; }},
        {"x.rdx: info: a picture of 4294967295 x 480",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->picture_width = 0xFFFFFFFFu; }},
        {"x.rdx: names: a name of 4294967295 bytes",
         [](LiarOfTrees& l) { l.at<rdx::Info>(rdx::info, 0)->scene_name_bytes = 0xFFFFFFFFu; }},
        {"x.rdx: names: a name of 77 bytes",
         [](LiarOfTrees& l) { l.at<rdx::Camera>(rdx::cameras, 1)->name_bytes = 77; }},
        {"x.rdx: names: 2 bytes belong to no name",
         [](LiarOfTrees& l) { l.at<rdx::Camera>(rdx::cameras, 0)->name_bytes -= 2; }},
        {"x.rdx: cameras: camera 0 is not finite",
         [](LiarOfTrees& l) { l.at<rdx::Camera>(rdx::cameras, 0)->up.y = infinity; }},
        {"x.rdx: cameras: camera 1 has the angle 0",
         [](LiarOfTrees& l) { l.at<rdx::Camera>(rdx::cameras, 1)->vfov = 0; }},
    };
}

std::vector<TreeLie> lies_in_header() {
    const auto section = [](rdx::SectionId id, std::function<void(rdx::Section&)> change) {
        return [=](LiarOfTrees& l) {
            l.change_header([&](rdx::Header& h) { change(h.sections[id]); });
        };
    };
    return {
        {"x.rdx: nodes: 1099511627776 elements of 32 bytes, but",
         section(rdx::nodes, [](auto& s) { s.count = std::uint64_t{1} << 40; })},
        {"x.rdx: order: 4611686018427387904 elements",  // 4 bytes each: 2^64, which wraps to 0
         section(rdx::order, [](auto& s) { s.count = std::uint64_t{1} << 62; })},
        {"x.rdx: vertices: number 4 at byte 384",  // over the info section
         section(rdx::vertices, [](auto& s) { s.offset = 384; })},
        {"x.rdx: info: number 0 at byte 64", section(rdx::info, [](auto& s) { s.offset = 64; })},
        {"x.rdx: names: number 7 at byte 18446744073709551552",
         section(rdx::names, [](auto& s) { s.offset = ~std::uint64_t{63}; })},
        {"x.rdx: triangles: number 9", section(rdx::triangles, [](auto& s) { s.id = 9; })},
        {"x.rdx: nodes: elements of 0 bytes",
         section(rdx::nodes, [](auto& s) { s.element_bytes = 0; })},
        {"x.rdx: nodes: elements of 31 bytes",
         section(rdx::nodes, [](auto& s) { s.element_bytes = 31; })},
        {"x.rdx: nodes: number 1", section(rdx::info, [](auto& s) { s.count = 2; })},
        {"x.rdx: header: 9 sections",
         [](LiarOfTrees& l) { l.change_header([](auto& h) { h.section_count = 9; }); }},
        {"x.rdx: header: the reserved bytes",
         [](LiarOfTrees& l) { l.change_header([](auto& h) { h.reserved[23] = 1; }); }},
    };
}

TEST_F(Rdx, LiesUnderRightChecksumsAreNamed) {
    Model scene = make_scene(100);
    scene.cameras.cameras[1].name = "x";
    const Bytes whole = saved(folder_, build_bvh(scene.mesh(), {.max_leaf = 2}), scene);
    expect_told(whole, lies_in_content());
    expect_told(whole, lies_in_header());
}

TEST_F(Rdx, WrongVersionIsSaid) {
    const Model scene = make_scene(3);
    Bytes bytes = saved(folder_, build_bvh(scene.mesh()), scene);
    rdx::Header header = header_of(bytes);
    header.version = 5;
    header.checksum = rdx::header_checksum(std::as_bytes(std::span(&header, 1)));
    std::memcpy(bytes.data(), &header, sizeof(header));
    EXPECT_EQ(verdict(bytes), "x.rdx: header: version 5; this program reads 1 to 4");
}

TEST_F(Rdx, SectionsAreAligned) {
    const Model scene = make_scene(77);
    const Bytes bytes = saved(folder_, build_bvh(scene.mesh()), scene);
    for (const rdx::Section& s : header_of(bytes).sections) EXPECT_EQ(s.offset % 64, 0u);
    const RdxFile loaded = load_rdx(folder_.path() / "scene.rdx");
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(loaded.bvh.nodes().data()) % 64, 0u);
}

}  // namespace
}  // namespace raydix::test
