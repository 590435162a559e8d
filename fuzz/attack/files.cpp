// .rdx files: what was saved comes back the same; bytes changed at random, checksums mended, are
// refused or load to a tree that bears its check and rays.
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <unistd.h>
#include <cstddef>
#include <filesystem>
#include <fstream>

#include "api/rdx_parse.h"
#include "attack/attack.h"
#include "attack/ray_families.h"
#include "support/rdx_seal.h"

namespace raydix::attack {
namespace {

using Bytes = std::vector<std::byte>;

/// A file of this process, removed in the end.
class ScratchFile {
public:
    ScratchFile()
        : path_(std::filesystem::temp_directory_path() /
                ("raydix_attack_" + std::to_string(getpid()) + ".rdx")) {}
    ~ScratchFile() {
        std::error_code ignored;
        std::filesystem::remove(path_, ignored);
    }
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

Bytes read_all(const std::filesystem::path& file) {
    Bytes bytes(std::filesystem::file_size(file));
    std::ifstream in(file, std::ios::binary);
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

/// Changes a few bytes or words, or copies a stretch elsewhere; sometimes cuts the end off.
Bytes mutated(Random& random, const Bytes& sound) {
    Bytes bytes = sound;
    const std::uint32_t changes = 1 + random.below(3);
    constexpr std::uint32_t words[] = {
        0, 1, 2, 3, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu, 0x7F800000u, 0x7FC00000u, 0x00000100u};
    for (std::uint32_t i = 0; i < changes; ++i) {
        // Headers are short: they get half of the changes.
        const std::size_t reach = random.chance(0.5)
                                      ? std::min<std::size_t>(bytes.size(), sizeof(rdx::Header))
                                      : bytes.size();
        const std::size_t place = random.below(reach);
        switch (random.below(4)) {
            case 0:
                bytes[place] ^= static_cast<std::byte>(1u << random.below(8));
                break;
            case 1:
                bytes[place] = static_cast<std::byte>(random.below(256));
                break;
            case 2: {
                const std::size_t aligned = std::min(place & ~std::size_t{3}, bytes.size() - 4);
                std::uint32_t word = random.one_of(words);
                if (random.chance(0.3)) {
                    std::memcpy(&word, bytes.data() + aligned, 4);
                    word += random.chance(0.5) ? 1u : 0xFFFFFFFFu;
                }
                std::memcpy(bytes.data() + aligned, &word, 4);
                break;
            }
            default: {
                const std::size_t length = std::min<std::size_t>(32, bytes.size() - place);
                const std::size_t from = random.below(bytes.size() - length + 1);
                std::memmove(bytes.data() + place, bytes.data() + from, length);
            }
        }
    }
    if (random.chance(0.05)) bytes.resize(random.below(bytes.size()));
    return bytes;
}

/// Refused with one line, or a tree that can be used.
void load_mutated(Case& c, const Bytes& bytes, const BuildOptions& options) {
    const std::shared_ptr<void> owner = allocate_bytes(bytes.size() + 1);
    const std::span<std::byte> view(static_cast<std::byte*>(owner.get()), bytes.size());
    std::copy(bytes.begin(), bytes.end(), view.begin());
    if (view.size() >= sizeof(rdx::Header)) test::seal_rdx(view);
    try {
        const RdxFile file = rdx::parse("attack.rdx", view, owner);
        const CheckReport report = check(file.bvh);
        c.expect(report.ok, "files/mutated that loaded", "a file with a broken tree was loaded",
                 [&] { return "    " + report.broken + "\n    " + text_of(options) + "\n"; });
        (void)tree_stats(file.bvh, {.with_hash = false, .threads = 1});
        if (file.bvh.kind() != PrimitiveKind::triangles) return;
        const std::vector<Ray> rays = make_rays(c.random, file.scene.mesh(), 8);
        (void)trace(file.bvh, rays, {.threads = 1});
        (void)trace(WideBvh(file.bvh, {.threads = 1}), rays, {.threads = 1});
    } catch (const InputError& error) {
        const std::string message = error.what();
        c.expect(message.find('\n') == std::string::npos, "files/mutated that were refused",
                 "an error of several lines", [&] { return "    " + message + "\n"; });
    }
}

}  // namespace

static void attack_files(Case& c) {
    const TestMesh made = any_mesh(c.random, 40);
    const BuildOptions options = any_build_options(c.random);
    const Bvh tree = build_bvh(made.mesh, options);
    const ScratchFile file;
    Model scene;
    scene.name = "attack";
    scene.meshes = {made.mesh};
    save_rdx(file.path(), tree, scene);
    {
        const RdxFile back = load_rdx(file.path());
        const CheckReport same = check_same(tree, back.bvh);
        c.expect(same.ok && tree_hash(tree) == tree_hash(back.bvh), "files/saved",
                 "a saved tree comes back the same",
                 [&] { return "    " + same.broken + "\n    " + text_of(options) + "\n"; });
        const std::vector<Ray> rays = make_rays(c.random, made.mesh, 40);
        c.expect(
            same_bytes(trace(tree, rays, {.threads = 1}), trace(back.bvh, rays, {.threads = 1})),
            "files/saved", "hits of a saved tree");
    }
    const Bytes sound = read_all(file.path());
    constexpr int mutations = 60;
    for (int i = 0; i < mutations; ++i) load_mutated(c, mutated(c.random, sound), options);
}

static const Kind kind("files", attack_files, 0.5);

}  // namespace raydix::attack
