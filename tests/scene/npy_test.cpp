#include "scene/npy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numeric>
#include <sstream>

#include "samples.h"
#include "support/support.h"

namespace raydix::test {
namespace {

template <class T>
std::string numbers(std::initializer_list<T> values, bool big_endian = false) {
    std::string bytes;
    for (const T value : values) bytes += raw(value, big_endian);
    return bytes;
}

std::string file_text(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
}

TEST(Npy, types_orders_and_further_columns) {
    const std::vector<std::string> same{
        npy("<f4", "False", "(2, 3)", numbers<float>({1, 2, 3, 4, 5, 6})),
        npy("<f8", "False", "(2, 4)", numbers<double>({1, 2, 3, 0, 4, 5, 6, 0})),
        npy(">f4", "True", "(2, 3)", numbers<float>({1, 4, 2, 5, 3, 6}, true)),
        npy(">f8", "True", "(2L, 3)", ""),
        npy("=f4", "False", "(2, 3)", numbers<float>({1, 2, 3, 4, 5, 6}) + "what follows"),
    };
    for (const std::string& bytes : same) {
        if (bytes.find('L') != std::string::npos) {
            EXPECT_NE(error_of(load_npy_points, bytes), "");
            continue;
        }
        const Mesh mesh = load(load_npy_points, bytes);
        ASSERT_EQ(mesh.vertices.size(), 2u);
        EXPECT_EQ(mesh.vertices[0].y, 2.0f);
        EXPECT_EQ(mesh.vertices[1].x, 4.0f);
        EXPECT_EQ(mesh.vertices[1].z, 6.0f);
    }
    EXPECT_EQ(load(load_npy_points, npy("<f4", "False", "(0, 3)", "")).vertices.size(), 0u);
}

TEST(Npy, says_what_is_wrong) {
    const auto error = [](const std::string& bytes) { return error_of(load_npy_points, bytes); };
    EXPECT_EQ(error(npy("<f4", "False", "(2, 3)", numbers<float>({1, 2, 3, 4, 5}))),
              "sample: row 2: file ends before all 2 rows");
    EXPECT_EQ(error(npy("<f4", "False", "(6,)", "")),
              "sample: header: shape (6,); (N, 3) is needed");
    EXPECT_EQ(error(npy("<i4", "False", "(2, 3)", "")),
              "sample: header: type \"<i4\"; float32 or float64 is needed");
    EXPECT_EQ(error(npy("<f4", "maybe", "(2, 3)", "")),
              "sample: header: fortran_order is neither True nor False");
    EXPECT_EQ(error("hello, world!"), "sample: header: not an .npy file");
    for (const std::string order : {"True", "False"}) {
        EXPECT_NE(error(npy("<f8", order, "(18446744073709551615, 3)", "12345678")), "");
        EXPECT_NE(error(npy("<f8", order, "(1, 18446744073709551615)", "12345678")), "");
    }
}

TEST(Npy, rays_come_back) {
    const TempFolder folder;
    const auto file = folder.path() / "rays.npy";
    std::vector<float> rays(80);
    std::iota(rays.begin(), rays.end(), -3.0f);
    rays[7] = infinity;
    rays[3] = -0.0f;
    save_npy(file, std::span<const float>(rays), 8);
    const std::vector<float> back = load_npy(file, 8);
    ASSERT_EQ(back.size(), rays.size());
    EXPECT_EQ(std::memcmp(back.data(), rays.data(), rays.size() * sizeof(float)), 0);
    EXPECT_THROW(static_cast<void>(load_npy(file, 7)), InputError);
    EXPECT_THROW(save_npy(folder.path() / "none" / "rays.npy", std::span<const float>(rays), 8),
                 InputError);
}

TEST(Npy, hits_are_structured) {
    const TempFolder folder;
    const std::vector<TreeHit> hits{{1.5f, 7, 0.25f, 0.5f}, {}};
    save_npy(folder.path() / "hits.npy", std::span<const TreeHit>(hits));
    const std::string bytes = file_text(folder.path() / "hits.npy");
    ASSERT_EQ(bytes.size() % 64, 32u);
    EXPECT_NE(bytes.find("{'descr': [('t', '<f4'), ('prim', '<u4'), ('u', '<f4'), ('v', '<f4')], "
                         "'fortran_order': False, 'shape': (2,), }"),
              std::string::npos);
    EXPECT_EQ(std::memcmp(bytes.data() + bytes.size() - 32, hits.data(), 32), 0);
    EXPECT_EQ(bytes[bytes.size() - 33], '\n');
}

TEST(Npy, shapes_of_index_arrays) {
    const TempFolder folder;
    const std::vector<std::uint64_t> offsets{0, 2, 5};
    save_npy(folder.path() / "offsets.npy", std::span<const std::uint64_t>(offsets));
    EXPECT_NE(file_text(folder.path() / "offsets.npy")
                  .find("'<u8', 'fortran_order': False, 'shape': (3,)"),
              std::string::npos);
    const std::vector<std::uint32_t> pairs{0, 2, 5, 6};
    save_npy(folder.path() / "pairs.npy", std::span<const std::uint32_t>(pairs), 2);
    EXPECT_NE(file_text(folder.path() / "pairs.npy")
                  .find("'<u4', 'fortran_order': False, 'shape': (2, 2)"),
              std::string::npos);
}

}  // namespace
}  // namespace raydix::test
