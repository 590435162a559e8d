// .rdx files of trees: what was saved comes back the same; bytes changed at random, checksums
// mended, are refused or load to a tree that bears its check and rays. Files of scenes take turns
// with them.
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include "attack/attack.h"
#include "attack/file_bytes.h"
#include "attack/ray_families.h"
#include "io/rdx_format.h"
#include "io/rdx_parse.h"

namespace raydix::attack {
namespace {

constexpr std::string_view tree_sections[] = {
    "header", "info", "nodes", "order", "vertices", "triangles", "primitives", "cameras", "names"};

/// Refused with one line, or a tree that can be used.
void load_mutated(Case& c, const Bytes& bytes, const BuildOptions& options) {
    const SealedFile sealed(bytes);
    try {
        const RdxFile file = rdx::parse("attack.rdx", sealed.view, sealed.owner);
        const CheckReport report = check(file.bvh);
        c.expect(report.ok, "files/mutated that loaded", "a file with a broken tree was loaded",
                 [&] { return "    " + report.broken + "\n    " + text_of(options) + "\n"; });
        (void)tree_stats(file.bvh, {.with_hash = false, .threads = 1});
        if (file.bvh.kind() != PrimitiveKind::triangles) return;
        const std::vector<Ray> rays = make_rays(c.random, file.scene.mesh(), 8);
        (void)trace(file.bvh, rays, {.threads = 1});
        (void)trace(WideBvh(file.bvh, {.threads = 1}), rays, {.threads = 1});
    } catch (const InputError& error) {
        expect_refusal(c, error, tree_sections);
    }
}

void attack_tree_file(Case& c) {
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
    const Bytes sound = file.bytes();
    // Headers are short: they get half of the changes.
    const Stretch stretches[] = {{0, sizeof(rdx::Header)}, {0, sound.size()}};
    constexpr int mutations = 60;
    for (int i = 0; i < mutations; ++i)
        load_mutated(c, mutated(c.random, sound, stretches), options);
}

void attack_files(Case& c) {
    if (c.index() % 2 == 0)
        attack_tree_file(c);
    else
        attack_scene_file(c);
}

}  // namespace

static const Kind files_kind("files", attack_files, 0.5);

}  // namespace raydix::attack
