// Files that each rank reads in part, against the same read whole.
#include <raydix/arrays.h>
#include <raydix/bvh.h>
#include <raydix/model.h>
#include <raydix/rdx.h>
#include <raydix/scene.h>
#include <unistd.h>

#include <bit>
#include <filesystem>
#include <fstream>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

/// A folder of rank 0 that all know.
class SharedFolder {
public:
    SharedFolder() {
        int id = int(getpid());
        MPI_Bcast(&id, 1, MPI_INT, 0, MPI_COMM_WORLD);
        path_ = std::filesystem::temp_directory_path() / ("raydix-parts-" + std::to_string(id));
        if (rank() == 0) std::filesystem::create_directory(path_);
    }
    ~SharedFolder() {
        MPI_Barrier(MPI_COMM_WORLD);
        if (rank() == 0) std::filesystem::remove_all(path_);
    }
    /// Rank 0 writes it once nobody reads one that was there before.
    std::filesystem::path write(const std::string& name, const std::string& bytes) const {
        MPI_Barrier(MPI_COMM_WORLD);
        if (rank() == 0) std::ofstream(path_ / name, std::ios::binary) << bytes;
        MPI_Barrier(MPI_COMM_WORLD);
        return path_ / name;
    }

private:
    std::filesystem::path path_;
};

template <class T>
void put(std::string& bytes, T value, bool big) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (big) std::reverse(raw, raw + sizeof(T));
    bytes.append(raw, sizeof(T));
}

/// Doubles with a colour between them, faces with a number behind the list; and something else
/// before both.
std::string rich_ply(int points, int triangles, bool big, int bad_face = -1) {
    std::mt19937 random(9);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                        "_endian 1.0\nelement camera 2\nproperty float f\nelement vertex " +
                        std::to_string(points) +
                        "\nproperty uchar red\nproperty double y\nproperty double x\nproperty "
                        "float z\nelement face " +
                        std::to_string(triangles) +
                        "\nproperty list ushort int vertex_indices\nproperty short part\n"
                        "end_header\n";
    put(bytes, 1.0f, big);
    put(bytes, 2.0f, big);
    for (int i = 0; i < points; ++i) {
        put(bytes, std::uint8_t(i), big);
        put(bytes, i == 3 ? -0.0 : unit(random), big);
        put(bytes, unit(random), big);
        put(bytes, float(unit(random)), big);
    }
    for (int i = 0; i < triangles; ++i) {
        put(bytes, std::uint16_t(3), big);
        for (int c = 0; c < 3; ++c)
            put(bytes, i == bad_face && c == 1 ? points : int(random() % unsigned(points)), big);
        put(bytes, std::int16_t(-i), big);
    }
    return bytes;
}

std::size_t begin_of(std::size_t n, int r) { return n * std::size_t(r) / std::size_t(ranks()); }

/// Corners are compared: a part has other indices.
void expect_same_part(const FilePart& part, const Mesh& whole) {
    EXPECT_EQ(part.vertices, whole.vertices.size());
    EXPECT_EQ(part.triangles, whole.triangles.size());
    if (whole.triangles.empty()) {
        const std::size_t begin = begin_of(whole.vertices.size(), rank());
        const auto expected =
            std::span(whole.vertices)
                .subspan(begin, begin_of(whole.vertices.size(), rank() + 1) - begin);
        EXPECT_TRUE(same_bits(part.mesh.vertices, expected));
        return;
    }
    const std::size_t begin = begin_of(whole.triangles.size(), rank());
    ASSERT_EQ(part.mesh.triangles.size(), begin_of(whole.triangles.size(), rank() + 1) - begin);
    EXPECT_LE(part.mesh.vertices.size(), 3 * part.mesh.triangles.size());
    std::size_t different = 0;
    for (std::size_t i = 0; i < part.mesh.triangles.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c)
            different += std::memcmp(&part.mesh.vertices[part.mesh.triangles[i][c]],
                                     &whole.vertices[whole.triangles[begin + i][c]], 12) != 0;
    EXPECT_EQ(different, 0u);
}

TEST(FileParts, AreThoseOfTheWholeFile) {
    const SharedFolder folder;
    for (const bool big : {false, true})
        for (const int triangles : {0, 1, 1000}) {
            SCOPED_TRACE(triangles);
            const auto file = folder.write("mesh.ply", rich_ply(500, triangles, big));
            const auto part = load_part(MPI_COMM_WORLD, file);
            ASSERT_TRUE(part.has_value());
            expect_same_part(*part, load_mesh(file));
        }
    std::vector<float> rows;
    for (int i = 0; i < 101 * 4; ++i) rows.push_back(float(i % 17) - 8.5f);
    const auto file = folder.write("points.npy", "");
    if (rank() == 0) save_array(file, rows, 4);
    MPI_Barrier(MPI_COMM_WORLD);
    const auto part = load_part(MPI_COMM_WORLD, file);
    ASSERT_TRUE(part.has_value());
    expect_same_part(*part, load_mesh(file));
}

Mesh soup(int triangles, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(-1, 1);
    Mesh mesh;
    for (int i = 0; i < triangles + 3; ++i)
        mesh.vertices.push_back({unit(random), unit(random), unit(random)});
    for (int i = 0; i < triangles; ++i) {
        Triangle& t = mesh.triangles.emplace_back();
        for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(random() % mesh.vertices.size());
    }
    return mesh;
}

/// Rank 0 saves.
template <class Save>
std::filesystem::path saved(const SharedFolder& folder, const Save& save) {
    const auto file = folder.write("saved.rdx", "");
    if (rank() == 0) save(file);
    MPI_Barrier(MPI_COMM_WORLD);
    return file;
}

TEST(FileParts, OfTreesAreThoseOfTheWholeFile) {
    const SharedFolder folder;
    for (const int triangles : {0, 1, 400}) {
        Model model;
        model.meshes.push_back(soup(triangles, 3));
        const auto file = saved(folder, [&](const std::filesystem::path& to) {
            save_rdx(to, build_bvh(model.mesh()), model);
        });
        const auto part = load_part(MPI_COMM_WORLD, file);
        ASSERT_TRUE(part.has_value());
        expect_same_part(*part, load_rdx(file).scene.mesh());
    }
}

TEST(FileParts, OfScenesGoMeshByMesh) {
    const SharedFolder folder;
    const Mesh first = soup(90, 5), second = soup(41, 6);
    Mesh both = first;
    both.vertices.insert(both.vertices.end(), second.vertices.begin(), second.vertices.end());
    for (const Triangle& t : second.triangles) {
        const auto n = static_cast<std::uint32_t>(first.vertices.size());
        both.triangles.push_back({t[0] + n, t[1] + n, t[2] + n});
    }
    const auto with = [&](const auto& add) {
        return saved(folder, [&](const std::filesystem::path& to) {
            Scene scene;
            scene.add(first);
            add(scene);
            scene.commit();
            save_rdx(to, scene);
        });
    };
    const auto part = load_part(MPI_COMM_WORLD, with([&](Scene& s) { s.add(second); }));
    ASSERT_TRUE(part.has_value());
    expect_same_part(*part, both);
    const auto has_part = [&](const auto& add) {
        return load_part(MPI_COMM_WORLD, with(add)).has_value();
    };
    EXPECT_FALSE(has_part([&](Scene& s) { s.add(Scene(second), Transform()); }));
    EXPECT_FALSE(has_part([&](Scene& s) { s.set_mask(s.add(second), 1); }));
    EXPECT_FALSE(has_part([&](Scene& s) { s.add(std::vector<Sphere>{{{0, 0, 0}, 1}}); }));
    EXPECT_FALSE(
        load_part(MPI_COMM_WORLD, saved(folder,
                                        [&](const std::filesystem::path& to) {
                                            Aabb box{{0, 0, 0}, {1, 1, 1}};
                                            save_rdx(to, build_bvh(std::span<const Aabb>(&box, 1)),
                                                     Model());
                                        }))
            .has_value());
}

TEST(FileParts, OfSeveralFilesCountThrough) {
    const SharedFolder folder;
    const auto expect_same = [&](const std::vector<int>& triangles) {
        std::vector<std::filesystem::path> files;
        Mesh whole;
        for (const int n : triangles) {
            const std::string name = "part" + std::to_string(files.size()) + ".ply";
            files.push_back(folder.write(name, rich_ply(50 + n, n, n % 2 == 0)));
            const Mesh one = load_mesh(files.back());
            const auto first = static_cast<std::uint32_t>(whole.vertices.size());
            whole.vertices.insert(whole.vertices.end(), one.vertices.begin(), one.vertices.end());
            for (const Triangle& t : one.triangles)
                whole.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
        }
        const auto part = load_part(MPI_COMM_WORLD, files);
        ASSERT_TRUE(part.has_value());
        expect_same_part(*part, whole);
    };
    expect_same({7, 0, 100, 1, 33});
    expect_same({0, 0, 0});
    const std::filesystem::path files[] = {folder.write("a.ply", rich_ply(9, 4, false)),
                                           folder.write("b.obj", "v 0 0 0\n")};
    EXPECT_FALSE(load_part(MPI_COMM_WORLD, files).has_value());
}

TEST(FileParts, OtherFilesAreForOneRank) {
    const SharedFolder folder;
    const std::string quads = [] {
        std::string bytes = rich_ply(10, 40, false);
        const std::size_t last = bytes.size() - 16;  // the last face has four corners
        bytes[last] = 4;
        return bytes + std::string(4, '\0');
    }();
    EXPECT_FALSE(load_part(MPI_COMM_WORLD, folder.write("quads.ply", quads)).has_value());
    EXPECT_FALSE(
        load_part(MPI_COMM_WORLD, folder.write("cut.ply", rich_ply(10, 40, false).substr(0, 500)))
            .has_value());
    EXPECT_FALSE(
        load_part(MPI_COMM_WORLD, folder.write("text.ply",
                                               "ply\nformat ascii 1.0\nelement vertex 0\n"
                                               "property float x\nproperty float y\nproperty "
                                               "float z\nend_header\n"))
            .has_value());
    EXPECT_FALSE(load_part(MPI_COMM_WORLD, folder.write("mesh.obj", "v 0 0 0\n")).has_value());
}

TEST(FileParts, WhatIsWrongIsSaidOnAll) {
    const SharedFolder folder;
    const auto message_of = [](const std::filesystem::path& file) -> std::string {
        try {
            (void)load_part(MPI_COMM_WORLD, file);
        } catch (const InputError& error) {
            return error.what();
        }
        return "nothing";
    };
    const std::string missing = message_of(folder.write("x.obj", "").parent_path() / "none.ply");
    EXPECT_EQ(missing.find("rank 0: "), 0u) << missing;
    EXPECT_NE(missing.find("none.ply: cannot be opened"), std::string::npos) << missing;
    const std::string no_rdx = message_of(folder.write("no.rdx", std::string(100, 'x')));
    EXPECT_NE(no_rdx.find("no.rdx: header: this is no .rdx file"), std::string::npos) << no_rdx;
    // The last face is of the last rank.
    const std::string wrong = message_of(folder.write("bad.ply", rich_ply(20, 64, true, 63)));
    EXPECT_EQ(wrong.find("rank " + std::to_string(ranks() - 1) + ": "), 0u) << wrong;
    EXPECT_NE(wrong.find("bad.ply: face 64: vertex 20, but there are 20"), std::string::npos)
        << wrong;
}

}  // namespace
}  // namespace raydix::mpi::test
