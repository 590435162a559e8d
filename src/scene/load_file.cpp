// File name -> reader by extension -> model.
#include <raydix/error.h>
#include <raydix/model.h>

#include <array>
#include <cctype>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/float_env.h"
#include "scene/formats.h"
#include "scene/input_error.h"

namespace raydix {
namespace {

constexpr std::string_view rdx_start = "\x89rdx\r\n\x1a\n";  // docs/rdx-format.md

std::string lower(std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
}

/// In lower case, without that of the packing.
std::string extension_of(const std::filesystem::path& file) {
    const bool is_packed = packing_of(file) != Packing::none;
    return lower((is_packed ? file.stem() : file).extension().string());
}

bool is_gltf(const std::string& extension) { return extension == ".gltf" || extension == ".glb"; }

Model load_gltf_file(ByteSource& in, const std::filesystem::path& file) {
    return load_gltf(in,
                     [&file, folder = file.parent_path()](const std::filesystem::path& relative) {
                         try {
                             return ByteSource::from_file(folder / relative, Packing::none);
                         } catch (const InputError& error) {
                             throw InputError(printable(file) + ": " + error.what());
                         }
                     });
}

Model model_of(Mesh mesh) {
    Model model;
    model.meshes.push_back(std::move(mesh));
    return model;
}

Model load_by_extension(ByteSource& in, const std::filesystem::path& file,
                        const std::string& extension) {
    in.fill(rdx_start.size());
    if (extension == ".rdx" || in.buffered().starts_with(rdx_start))
        in.fail("file",
                "holds a saved tree, which load_rdx reads, or a saved scene: load_rdx_scene, "
                "in Python load_scene");
    if (extension == ".ply") return model_of(load_ply(in));
    if (extension == ".obj") return model_of(load_obj(in));
    if (extension == ".stl") return model_of(load_stl(in));
    if (extension == ".off") return model_of(load_off(in));
    if (extension == ".xyz") return model_of(load_xyz(in));
    if (extension == ".npy") return model_of(load_npy_points(in));
    if (is_gltf(extension)) return load_gltf_file(in, file);
    in.fail(
        "file name",
        "ends in none of .ply .obj .stl .off .xyz .npy .gltf .glb, with or without .gz .xz .zst, "
        "nor in .rdx");
}

}  // namespace

Model load_file(const std::filesystem::path& file) {
    const FloatEnvironment exact;
    ByteSource in = ByteSource::from_file(file, packing_of(file));
    try {
        Model model = load_by_extension(in, file, extension_of(file));
        in.finish();
        model.name = printable(file.filename());
        for (Mesh& mesh : model.meshes) mesh.name = model.name;
        return model;
    } catch (const std::bad_alloc&) {
        in.fail("mesh", "needs more memory than there is");
    } catch (const std::length_error&) {
        in.fail("mesh", "needs more memory than there is");
    }
}

std::vector<std::filesystem::path> files_of(const std::filesystem::path& file) {
    std::vector<std::filesystem::path> files{file};
    std::error_code ignored;
    // what is no regular file can be read once
    if (!is_gltf(extension_of(file)) || !std::filesystem::is_regular_file(file, ignored))
        return files;
    ByteSource in = ByteSource::from_file(file, packing_of(file));
    for (const std::filesystem::path& relative : gltf_external_files(in))
        files.push_back(file.parent_path() / relative);
    return files;
}

Mesh load_mesh(const std::filesystem::path& file) {
    Model model = load_file(file);
    model.flatten();
    return std::move(model).mesh();
}

}  // namespace raydix
