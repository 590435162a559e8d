// The LBVH over ranks has the hash of build_bvh's, however triangles are spread.
#include <raydix/bvh.h>
#include <raydix/error.h>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

/// Triangles of all sizes, some at the same place and some that are left out.
Mesh make_mixed(std::size_t triangles, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(-1, 1);
    Mesh mesh;
    const auto corner = [&](Vec3 middle, float size) {
        return Vec3{middle.x + size * unit(random), middle.y + size * unit(random),
                    middle.z + size * unit(random)};
    };
    for (std::size_t i = 0; i < triangles; ++i) {
        const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
        const Vec3 middle{unit(random), unit(random), unit(random)};
        const float size = i % 7 == 0 ? 0.5f : 0.01f;
        for (int k = 0; k < 3; ++k) mesh.vertices.push_back(corner(middle, size));
        if (i % 5 != 0 && i > 0)
            for (std::uint32_t k = 0; k < 3; ++k)
                mesh.vertices[v + k] = mesh.vertices[v - 3 + k];  // equal codes
        if (i % 31 == 30) mesh.vertices[v].x = std::numeric_limits<float>::quiet_NaN();
        if (i % 37 == 0) mesh.vertices[v].y = -0.0f;
        mesh.triangles.push_back({v, v + 1, v + 2});
    }
    return mesh;
}

/// Of the part that `begins` gives this rank.
std::string spread_hash(MPI_Comm comm, const Mesh& whole, const std::vector<std::size_t>& begins,
                        const BuildOptions& options) {
    return tree_hash(comm, MeshView(whole.vertices, mine(whole.triangles, begins)), options);
}

TEST(TreeHashOverRanks, IsThatOfOneProcess) {
    unsigned seed = 0;
    for (const std::size_t triangles : {0u, 1u, 2u, 3u, 9u, 60u, 700u})
        for (const Division division : divisions)
            for (const int max_leaf : {1, 4, 255}) {
                SCOPED_TRACE("seed " + std::to_string(++seed));
                const Mesh mesh = make_mixed(triangles, seed);
                BuildOptions options;
                options.bits = seed % 2 == 0 ? 30 : 63;
                options.max_leaf = max_leaf;
                options.threads = 1;
                EXPECT_EQ(spread_hash(MPI_COMM_WORLD, mesh, division_of(triangles, division, seed),
                                      options),
                          raydix::tree_hash(build_bvh(mesh, options)));
            }
}

/// More nodes on a rank than go into one message.
TEST(TreeHashOverRanks, GoesInSeveralMessages) {
    const Mesh mesh = make_mixed(30000, 5);
    BuildOptions options;
    options.max_leaf = 1;
    EXPECT_EQ(spread_hash(MPI_COMM_WORLD, mesh, division_of(30000, Division::even, 1), options),
              raydix::tree_hash(build_bvh(mesh, options)));
}

/// Some of the ranks, so that odd numbers of them are met too.
TEST(TreeHashOverRanks, OfAnyNumberOfRanks) {
    const Mesh mesh = make_mixed(500, 3);
    const std::string expected = raydix::tree_hash(build_bvh(mesh));
    for (int count = 1; count <= ranks(); ++count) {
        MPI_Comm some = MPI_COMM_NULL;
        MPI_Comm_split(MPI_COMM_WORLD, rank() < count ? 0 : MPI_UNDEFINED, rank(), &some);
        if (some == MPI_COMM_NULL) continue;
        const auto n = mesh.triangles.size(), r = static_cast<std::size_t>(rank()),
                   all = static_cast<std::size_t>(count);
        const std::span<const Triangle> part =
            std::span(mesh.triangles).subspan(n * r / all, n * (r + 1) / all - n * r / all);
        EXPECT_EQ(tree_hash(some, MeshView(mesh.vertices, part)), expected) << count << " ranks";
        MPI_Comm_free(&some);
    }
}

TEST(TreeHashOverRanks, RefusesWhatHasNoHash) {
    const Mesh mesh = make_mixed(20, 1);
    const auto refused = [&](const MeshView& given, const BuildOptions& options) {
        try {
            static_cast<void>(tree_hash(MPI_COMM_WORLD, given, options));
        } catch (const InputError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    const auto with = [](auto change) {
        BuildOptions options;
        change(options);
        return options;
    };
    const auto has = [](const std::string& text, const char* part) {
        return text.find(part) != std::string::npos ? "" : "\"" + text + "\" lacks " + part;
    };
    EXPECT_EQ(has(refused(mesh, with([](auto& o) { o.builder = Builder::ploc; })), "karras"), "");
    EXPECT_EQ(has(refused(mesh, with([](auto& o) { o.reinsertion_rounds = 1; })), "karras"), "");
    EXPECT_EQ(has(refused(mesh, with([](auto& o) { o.bits = 31; })), "30 or 63"), "");
    EXPECT_EQ(has(refused(mesh, with([](auto& o) { o.max_leaf = 0; })), "1 to 255"), "");
    Mesh broken;
    broken.triangles.push_back({0, 1, 2});
    const bool is_last = rank() == ranks() - 1;
    EXPECT_EQ(has(refused(is_last ? MeshView(broken) : MeshView(mesh), {}),
                  "triangle 0 refers to a vertex"),
              "");
    Mesh bad = mesh;
    bad.vertices[3].x = std::numeric_limits<float>::infinity();
    EXPECT_EQ(
        has(refused(is_last ? MeshView(bad) : MeshView(), with([](auto& o) { o.strict = true; })),
            "not finite"),
        "");
    if (ranks() > 1) {
        EXPECT_EQ(has(refused(mesh, with([](auto& o) { o.max_leaf = 1 + rank() % 2; })),
                      "the ranks differ"),
                  "");
    }
}

}  // namespace
}  // namespace raydix::mpi::test
