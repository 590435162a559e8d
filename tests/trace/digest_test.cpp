// Trees and hits of small built-in scenes against digests kept here: the same bits on every
// processor, whatever its instructions and its compiler. Where one differs, the first column that
// differs says which step did it: scene, rays, tree or hits.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>
#include <xxhash.h>

#include <fmt/format.h>

#include <ostream>

#include "support/cwbvh_trace.h"
#include "support/ray_sets.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t digest_seed = 12;
constexpr std::size_t ray_count = 3000;

template <class T>
std::string digest(std::span<const T> values) {
    return fmt::format("{:016x}", XXH3_64bits(values.data(), values.size_bytes()));
}

template <class T>
std::string digest(const std::vector<T>& values) {
    return digest(std::span<const T>(values));
}
/// Of t, prim, u and v alone.
std::string digest(const std::vector<Hit>& hits) {
    return digest(std::vector<TreeHit>(hits.begin(), hits.end()));
}

struct Digests {
    const char* scene;
    const char *vertices, *rays;
    const char *lbvh, *ploc, *binned, *sbvh;  // first half of tree_hash
    const char *closest, *all;
};

constexpr Digests known[] = {
    {"builtin:atrium?triangles=10000", "9b189ca5b773022f", "abef4cab60fadd6b", "b0c9063e6200a84a",
     "326c0dc8b535350b", "f66f16a2dcf88ff9", "aa749bd46b157532", "6bb3a053e06b8f76",
     "eb6f98938f6e90f3"},
    {"builtin:figure?triangles=10000", "86169cf030e543a6", "ac760758788a2d24", "866077f163dadbef",
     "9ae7a66050e32c98", "8b66d61ccbd2e119", "62916fb590f4e3e8", "81d9c71c73ac49b8",
     "3354f38048ec4076"},
    {"builtin:grove?triangles=10000", "fec19bb12fb78fd9", "dfe5e99bd7359ece", "4ff96a6826b72639",
     "6b1084891925e578", "87a2e50c4453800f", "511602fff714d2a1", "185f6cfdf2b509c2",
     "5c2079b985c83e16"},
    {"builtin:soup?triangles=10000", "0e6a9a461ef361d2", "3f8d78360de16f29", "f0b7bd9717862a30",
     "d96209d38419eacf", "f82f7788c9d67c29", "30b4926d88007127", "73378adb91a22777",
     "3946cdd521486855"},
};

std::string tree_digest(const MeshView& mesh, Builder builder) {
    return tree_hash(build_bvh(mesh, {.builder = builder})).substr(0, 16);
}

void PrintTo(const Digests& digests, std::ostream* out) { *out << digests.scene; }

class Digest : public testing::TestWithParam<Digests> {};

TEST_P(Digest, SceneRaysTreesAndHits) {
    const Digests& wanted = GetParam();
    const Model scene = load_model(wanted.scene);
    const auto rays = make_mixed_rays(scene, ray_count, digest_seed);
    EXPECT_EQ(digest(scene.mesh().vertices), wanted.vertices);
    EXPECT_EQ(digest(rays), wanted.rays);
    EXPECT_EQ(tree_digest(scene.mesh(), Builder::karras), wanted.lbvh);
    EXPECT_EQ(tree_digest(scene.mesh(), Builder::apetrei), wanted.lbvh);
    EXPECT_EQ(tree_digest(scene.mesh(), Builder::ploc), wanted.ploc);
    EXPECT_EQ(tree_digest(scene.mesh(), Builder::binned), wanted.binned);
    EXPECT_EQ(tree_digest(scene.mesh(), Builder::sbvh), wanted.sbvh);

    const Bvh bvh = build_bvh(scene.mesh());
    EXPECT_EQ(digest(trace(bvh, rays)), wanted.closest) << "scalar";
    const WideBvh wide(bvh);
    for (const std::string& isa : simd_instruction_sets()) {
        for (const SimdPath path :
             {SimdPath::single, SimdPath::packet, SimdPath::stream, SimdPath::sorted})
            EXPECT_EQ(digest(trace(wide, rays, {.path = path, .isa = isa})), wanted.closest)
                << isa << ", " << simd_path_name(path);
        EXPECT_EQ(digest(trace_all(wide, rays, {.isa = isa}).hits), wanted.all) << isa;
    }
    EXPECT_EQ(digest(trace(Cwbvh(bvh), rays)), wanted.closest) << "cwbvh";
    EXPECT_EQ(digest(trace_all(bvh, rays).hits), wanted.all) << "scalar";
}

INSTANTIATE_TEST_SUITE_P(Builtin, Digest, testing::ValuesIn(known));

}  // namespace
}  // namespace raydix::test
