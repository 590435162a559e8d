// Files: names, folders, rights, external buffers, the whole way of load_mesh.
#include <gtest/gtest.h>
#include <raydix/model.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "samples.h"
#include "scene/input_error.h"
#include "support/support.h"

namespace raydix::test {
namespace {

void write(const std::filesystem::path& file, std::string_view bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
}

std::string file_error(const std::filesystem::path& file) {
    try {
        static_cast<void>(load_mesh(file));
    } catch (const InputError& error) {
        return error.what();
    }
    return {};
}

TEST(LoadMesh, each_extension_packed_or_not) {
    const TempFolder folder;
    write(folder.path() / "quad.bin", gltf_buffer());
    for (const Sample& sample : samples()) {
        const std::string extension = "." + sample.name.substr(0, sample.name.find('_'));
        write(folder.path() / ("A" + extension), sample.bytes);
        write(folder.path() / ("b" + extension + ".gz"), pack(sample.bytes, Packing::gzip));
        const Mesh mesh = load_mesh(folder.path() / ("A" + extension));
        EXPECT_EQ(mesh.triangles.size(), sample.has_triangles ? 2u : 0u) << sample.name;
        EXPECT_EQ(mesh.name, "A" + extension);
        EXPECT_EQ(load_mesh(folder.path() / ("b" + extension + ".gz")).triangles, mesh.triangles);
    }
    write(folder.path() / "C.PLY.XZ", pack(ascii_ply(), Packing::xz));
    EXPECT_EQ(load_mesh(folder.path() / "C.PLY.XZ").triangles.size(), 2u);
}

TEST(LoadMesh, names_of_any_bytes) {
    const TempFolder folder;
    const auto file = folder.path() / "caf\xE9\n\xC3\xA9.obj";
    write(file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    EXPECT_TRUE(
        file_error(file).ends_with("/caf\\xE9\\x0A\xC3\xA9.obj: line 4: index 9 of 3 vertices"))
        << file_error(file);
    write(file, "v 0 0 0\n");
    EXPECT_EQ(load_mesh(file).name, "caf\\xE9\\x0A\xC3\xA9.obj");
}

TEST(LoadMesh, printable_text) {
    EXPECT_EQ(printable(std::string_view("a\tb\x7F\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80")),
              "a\\x09b\\x7F\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80");
    EXPECT_EQ(printable(std::string_view("\xC0\x80\xED\xA0\x80\xF4\x90\x80\x80\xC2\x85\xE2\x82")),
              "\\xC0\\x80\\xED\\xA0\\x80\\xF4\\x90\\x80\\x80\\xC2\\x85\\xE2\\x82");
}

TEST(LoadMesh, what_cannot_be_read) {
    const TempFolder folder;
    const std::string root = folder.path().string();
    EXPECT_EQ(file_error(folder.path() / "none.ply"),
              root + "/none.ply: cannot be opened: No such file or directory");
    std::filesystem::create_directory(folder.path() / "folder.ply");
    EXPECT_EQ(file_error(folder.path() / "folder.ply"),
              root + "/folder.ply: cannot be read: it is a directory");
    write(folder.path() / "a.txt", "");
    EXPECT_TRUE(file_error(folder.path() / "a.txt")
                    .starts_with(root + "/a.txt: file name: ends in none of .ply"));
    write(folder.path() / "a.RDX", "");
    EXPECT_TRUE(file_error(folder.path() / "a.RDX")
                    .ends_with("load_rdx reads, or a saved scene: load_rdx_scene, in Python "
                               "load_scene"));
    write(folder.path() / "secret.obj", "v 0 0 0\n");
    std::filesystem::permissions(folder.path() / "secret.obj", std::filesystem::perms::none);
    if (geteuid() != 0) {
        EXPECT_EQ(file_error(folder.path() / "secret.obj"),
                  root + "/secret.obj: cannot be opened: Permission denied");
    }
    write(folder.path() / "a.gltf", gltf_json(R"("uri":"absent.bin",)"));
    EXPECT_EQ(
        file_error(folder.path() / "a.gltf"),
        root + "/a.gltf: " + root + "/absent.bin: cannot be opened: No such file or directory");
}

TEST(LoadModel, cameras_of_another_program) {
    const TempFolder folder;
    write(folder.path() / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::string file = (folder.path() / "a.obj").string();
    EXPECT_EQ(load_model(file).cameras_fault, "");
    write(folder.path() / "cameras.json", R"([{"id":0}])");
    const Model model = load_model(file);
    EXPECT_EQ(model.cameras_fault,
              (folder.path() / "cameras.json").string() + ": camera 1: position is missing");
    EXPECT_EQ(model.cameras.cameras.size(), 1u);
    EXPECT_EQ(load_flat_model(file).cameras_fault, model.cameras_fault);
}

TEST(LoadMesh, crown) {
    const auto file = shared_scene("crown/crown.ply.xz");
    RAYDIX_SKIP_WITHOUT(file);
    const Mesh mesh = load_mesh(file);
    EXPECT_EQ(mesh.triangles.size(), 3'540'202u);
    EXPECT_EQ(mesh.vertices.size(), 1'792'842u);
}

}  // namespace
}  // namespace raydix::test
