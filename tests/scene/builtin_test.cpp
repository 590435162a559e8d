// Built-in scenes: counts, the same bits everywhere, what each scene promises, errors of
// specifications.
#include "scene/builtin.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <map>

#include <raydix/error.h>
#include <raydix/trace.h>

#include "base/math.h"
#include "exec/parallel.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix {
namespace {

void brute_force(const Mesh& mesh, std::span<const Ray> rays, std::span<Hit> hits) {
    std::ranges::copy(trace_brute_force(mesh, rays), hits.begin());
}

BuiltinResult make(const std::string& spec, std::uint64_t seed = 1) {
    return make_builtin(spec, seed, brute_force);
}

/// XXH3, 128 bits, of the vertices' and then the indices' bytes.
std::string hash_of(const Mesh& mesh) {
    XXH3_state_t* state = XXH3_createState();
    XXH3_128bits_reset(state);
    XXH3_128bits_update(state, mesh.vertices.data(), mesh.vertices.size() * sizeof(Vec3));
    XXH3_128bits_update(state, mesh.triangles.data(), mesh.triangles.size() * sizeof(Triangle));
    const XXH128_hash_t hash = XXH3_128bits_digest(state);
    XXH3_freeState(state);
    return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

Aabb bounds_of(const Mesh& mesh) {
    Aabb box = empty_box();
    for (const Vec3& p : mesh.vertices) box = unite(box, {p, p});
    return box;
}

bool contains(const Aabb& box, Vec3 p) {
    return unite(box, {p, p}).lo == box.lo && unite(box, {p, p}).hi == box.hi;
}

double area_of(const Mesh& mesh, const Triangle& t) {
    const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
    const double ux = double(b.x) - a.x, uy = double(b.y) - a.y, uz = double(b.z) - a.z;
    const double vx = double(c.x) - a.x, vy = double(c.y) - a.y, vz = double(c.z) - a.z;
    const double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    return 0.5 * std::sqrt(x * x + y * y + z * z);
}

/// How many boxes of triangles hold the centre of a triangle's box, on average over `samples`.
double mean_overlap(const Mesh& mesh, std::size_t samples) {
    std::vector<Aabb> boxes;
    for (const Triangle& t : mesh.triangles)
        boxes.push_back(box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]));
    std::size_t held = 0;
    for (std::size_t i = 0; i < samples; ++i) {
        const Vec3 center = center_of(boxes[i * boxes.size() / samples]);
        for (const Aabb& box : boxes) held += contains(box, center) ? 1 : 0;
    }
    return static_cast<double>(held) / static_cast<double>(samples);
}

void expect_input_error(const std::string& spec, const std::vector<std::string>& words) {
    try {
        (void)make(spec);
        ADD_FAILURE() << spec << " was accepted";
    } catch (const InputError& error) {
        for (const std::string& word : words)
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos)
                << spec << " gave: " << error.what();
    }
}

class BuiltinMeshes : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Scenes, BuiltinMeshes, testing::Values("atrium", "grove", "figure"));

TEST_P(BuiltinMeshes, MeetTheWantedCount) {
    for (const std::uint64_t wanted :
         {10'000u, 16'000u, 74'999u, 75'000u, 100'000u, 300'000u, 1'000'000u}) {
        if (wanted > test::fewer(100'000 * test::thorough, 2)) continue;
        const Mesh mesh = make(fmt::format("{}?triangles={}", GetParam(), wanted)).mesh;
        EXPECT_NEAR(static_cast<double>(mesh.triangles.size()), static_cast<double>(wanted),
                    0.05 * static_cast<double>(wanted));
    }
}

TEST_P(BuiltinMeshes, HaveIndicesInRangeAndNoZeroArea) {
    for (const int wanted : {10'000, 200'000}) {
        const Mesh mesh = make(fmt::format("{}?triangles={}", GetParam(), wanted)).mesh;
        std::size_t bad_indices = 0, flat = 0, beyond = 0;
        for (const Triangle& t : mesh.triangles) {
            const bool bad = *std::ranges::max_element(t) >= mesh.vertices.size();
            bad_indices += bad ? 1 : 0;
            flat += !bad && !(area_of(mesh, t) > 0.0) ? 1 : 0;
        }
        for (const Vec3& p : mesh.vertices)
            beyond += std::abs(p.x) < 100 && std::abs(p.y) < 100 && std::abs(p.z) < 100 ? 0 : 1;
        EXPECT_EQ(bad_indices, 0u);
        EXPECT_EQ(flat, 0u);
        EXPECT_EQ(beyond, 0u);  // NaN is not below 100
    }
}

TEST_P(BuiltinMeshes, HaveFiveDistinctCameras) {
    const BuiltinResult scene = make(fmt::format("{}?triangles=20000", GetParam()));
    ASSERT_EQ(scene.cameras.cameras.size(), 5u);
    EXPECT_GT(scene.cameras.ao_radius, 0.0f);
    for (const Camera& a : scene.cameras.cameras) {
        EXPECT_FALSE(a.position == a.target);
        EXPECT_EQ(std::ranges::count(scene.cameras.cameras, a.name, &Camera::name), 1);
    }
}

struct Pinned {
    const char* spec;
    const char* hash;
};

// The same on every machine: a change here is a change of the scenes, and of every number published
// with them.
constexpr Pinned pinned[] = {
    {"atrium?triangles=10000", "2c898bca6578c9e25498f7b6bb664665"},
    {"atrium?triangles=100000", "1529abaa563a64af27d94b69406298da"},
    {"grove?triangles=10000", "26981335c6e73808ca316ddea8091798"},
    {"grove?triangles=100000", "07a1297fa57571ddb8389267d45d0ce5"},
    {"figure?triangles=10000", "b46af036ac6f064c4879b8d61e431a99"},
    {"figure?triangles=100000", "0d4da986e654c79adce5aead93c9d8bb"},
    {"soup?triangles=1000", "a2ad11ad8af0101e9e6f3a9ddea17af0"},
    {"uniform?points=1000", "6c12e963476b37997df0098fc1189419"},
    {"clustered?points=1000&clusters=7", "e1663aee29e77ada550b2b3227022f0c"},
    {"lidar?points=1000&beams=16&triangles=10000", "18cc5f212da59c8cc4ebb108340ce171"},
};

TEST(Builtin, HaveTheSameBitsEverywhere) {
    for (const Pinned& scene : pinned)
        EXPECT_EQ(hash_of(make(scene.spec).mesh), scene.hash) << scene.spec;
}

TEST(Builtin, DoNotDependOnTheThreads) {
    for (const Pinned& scene : pinned) {
        for (const int threads : {1, 2, 7}) {
            if (test::thorough == 1 && threads != 7) continue;
            std::string hash;
            with_threads(threads, [&] { hash = hash_of(make(scene.spec).mesh); });
            EXPECT_EQ(hash, scene.hash) << scene.spec << " with " << threads << " threads";
        }
    }
}

TEST(Builtin, ChangeWithTheSeed) {
    for (const Pinned& scene : pinned) {
        const Mesh one = make(scene.spec, 1).mesh, two = make(scene.spec, 2).mesh;
        EXPECT_NE(hash_of(one), hash_of(two)) << scene.spec;
        EXPECT_EQ(one.vertices.empty(), two.vertices.empty());
    }
}

TEST(Builtin, AreListedWithTheirDefaults) {
    ASSERT_EQ(builtin_scenes().size(), 7u);
    for (const BuiltinScene& scene : builtin_scenes()) {
        EXPECT_FALSE(scene.what.empty());
        ASSERT_FALSE(scene.parameters.empty());
        for (const BuiltinParameter& p : scene.parameters) {
            EXPECT_LE(p.min_value, p.default_value) << scene.name << ' ' << p.name;
            EXPECT_LE(p.default_value, p.max_value) << scene.name << ' ' << p.name;
        }
    }
}

TEST(Builtin, EmptyRequestsGiveEmptyScenes) {
    for (const char* spec :
         {"soup?triangles=0", "uniform?points=0", "clustered?points=0", "lidar?points=0"}) {
        const Mesh mesh = make(spec).mesh;
        EXPECT_TRUE(mesh.vertices.empty()) << spec;
        EXPECT_TRUE(mesh.triangles.empty()) << spec;
    }
}

TEST(Builtin, BadSpecificationsNameThePart) {
    expect_input_error("atriun", {"atriun", "atrium", "lidar"});
    expect_input_error("", {"atrium"});
    expect_input_error("figure?triangle=10", {"figure", "'triangle'", "triangles"});
    expect_input_error("clustered?k=10", {"clustered", "'k'", "points", "clusters"});
    expect_input_error("figure?triangles=10&", {"triangles=10", "5000", "20000000"});
    expect_input_error("figure?triangles=20000001", {"triangles=20000001"});
    expect_input_error("soup?triangles=-1", {"triangles=-1"});
    expect_input_error("soup?triangles=1.5", {"triangles=1.5"});
    expect_input_error("soup?triangles=nan", {"triangles=nan"});
    expect_input_error("soup?triangles=10k", {"triangles=10k"});
    expect_input_error("soup?triangles=", {"triangles="});
    expect_input_error("soup?triangles", {"triangles="});
    expect_input_error("soup?&", {"''"});
    expect_input_error("soup?triangles=10&triangles=20", {"soup", "'triangles' is given twice"});
    EXPECT_EQ(make("soup?triangles=1e3").mesh.triangles.size(), 1000u);
    EXPECT_EQ(make("soup?").mesh.triangles.size(), 100'000u);
}

TEST(Atrium, HasHugeAndTinyTriangles) {
    for (const int wanted : {10'000, 100'000}) {
        const Mesh mesh = make(fmt::format("atrium?triangles={}", wanted)).mesh;
        double least = 1e30, most = 0.0;
        for (const Triangle& t : mesh.triangles) {
            least = std::min(least, area_of(mesh, t));
            most = std::max(most, area_of(mesh, t));
        }
        EXPECT_GT(most, 1e4 * least);
    }
}

TEST(Atrium, IsClosedAroundItsCameras) {
    const BuiltinResult scene = make("atrium?triangles=10000");
    const Aabb box = bounds_of(scene.mesh);
    std::vector<Ray> rays;
    std::mt19937_64 random(5);
    const auto sign = [&] { return static_cast<float>(random() >> 40) * 0x1p-23f - 1.0f; };
    for (const Camera& camera : scene.cameras.cameras) {
        EXPECT_TRUE(contains(box, camera.position)) << camera.name;
        for (int i = 0; i < 200; ++i)
            rays.push_back({camera.position, 0.0f, {sign(), sign(), sign()}});
    }
    std::size_t misses = 0;
    for (const Hit& hit : trace_brute_force(scene.mesh, rays)) misses += hit.hit() ? 0 : 1;
    EXPECT_EQ(misses, 0u) << "of " << rays.size();
}

TEST(Grove, OverlapsMoreThanASurface) {
    const std::size_t samples = test::sanitized ? 100 : 500;
    const std::string wanted = test::sanitized ? "?triangles=50000" : "?triangles=200000";
    const double grove = mean_overlap(make("grove" + wanted).mesh, samples);
    const double figure = mean_overlap(make("figure" + wanted).mesh, samples);
    EXPECT_GT(grove, 2.0 * figure) << "grove " << grove << ", figure " << figure;
}

struct Closedness {
    std::size_t unmatched = 0;  // directed edges without exactly one partner
    std::int64_t euler = 0;
};

Closedness closedness(const Mesh& mesh) {
    std::vector<std::uint64_t> edges;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k)
            edges.push_back(std::uint64_t{t[k]} << 32 | t[(k + 1) % 3]);
    std::ranges::sort(edges);
    Closedness result;
    for (std::size_t i = 0; i < edges.size(); ++i) {
        const bool twice = i > 0 && edges[i] == edges[i - 1];
        const bool paired = std::ranges::binary_search(edges, edges[i] << 32 | edges[i] >> 32);
        result.unmatched += twice || !paired ? 1 : 0;
    }
    result.euler = static_cast<std::int64_t>(mesh.vertices.size()) -
                   static_cast<std::int64_t>(edges.size() / 2) +
                   static_cast<std::int64_t>(mesh.triangles.size());
    return result;
}

/// Whether the triangles around each vertex form one fan: walking over shared edges visits them
/// all.
std::size_t pinched_vertices(const Mesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> next;  // (vertex, from) -> to
    std::vector<std::uint32_t> degree(mesh.vertices.size(), 0), first(mesh.vertices.size(), 0);
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            next[{t[k], t[(k + 1) % 3]}] = t[(k + 2) % 3];
            ++degree[t[k]];
            first[t[k]] = t[(k + 1) % 3];
        }
    std::size_t pinched = 0;
    for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
        std::uint32_t at = first[v], steps = 0;
        do {
            at = next[{v, at}];
            ++steps;
        } while (at != first[v] && steps <= degree[v]);
        pinched += steps == degree[v] ? 0 : 1;
    }
    return pinched;
}

std::size_t equal_positions(const Mesh& mesh) {
    std::vector<Vec3> points = mesh.vertices;
    const auto before = [](Vec3 a, Vec3 b) {
        return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
    };
    std::ranges::sort(points, before);
    std::size_t equal = 0;
    for (std::size_t i = 1; i < points.size(); ++i) equal += points[i] == points[i - 1] ? 1 : 0;
    return equal;
}

TEST(Figure, IsAClosedManifold) {
    for (const std::size_t wanted : {5'000u, 10'000u, 65'536u, 300'000u, 1'000'000u}) {
        if (wanted > 50'000 * test::thorough) continue;
        for (const std::uint64_t seed : {1u, 9u}) {
            const Mesh mesh = make(fmt::format("figure?triangles={}", wanted), seed).mesh;
            const Closedness closed = closedness(mesh);
            EXPECT_EQ(closed.unmatched, 0u) << wanted;
            EXPECT_EQ(closed.euler, 0) << wanted;  // one handle: the tail meets the foot
            EXPECT_EQ(equal_positions(mesh), 0u) << wanted;
            if (wanted < 100'000) {
                EXPECT_EQ(pinched_vertices(mesh), 0u) << wanted;
            }
        }
    }
}

TEST(Figure, FacesOutward) {
    const Mesh mesh = make("figure?triangles=20000").mesh;
    double volume = 0.0;  // by the divergence theorem
    for (const Triangle& t : mesh.triangles)
        volume += dot(mesh.vertices[t[0]], cross(mesh.vertices[t[1]], mesh.vertices[t[2]])) / 6.0;
    EXPECT_GT(volume, 0.5);
    EXPECT_LT(volume, 2.0);
}

TEST(Figure, HasNearlyEvenTriangles) {
    const Mesh mesh = make("figure?triangles=200000").mesh;
    std::vector<double> areas;
    for (const Triangle& t : mesh.triangles) areas.push_back(area_of(mesh, t));
    std::ranges::sort(areas);
    EXPECT_LT(areas[areas.size() * 95 / 100], 8.0 * areas[areas.size() * 5 / 100]);
}

TEST(Clustered, HasManyNearEqualPoints) {
    const Mesh mesh = make("clustered?points=20000&clusters=20").mesh;
    std::vector<float> x;
    for (const Vec3& p : mesh.vertices) x.push_back(p.x);
    std::ranges::sort(x);
    std::size_t near = 0;
    for (std::size_t i = 1; i < x.size(); ++i) near += x[i] - x[i - 1] < 1e-6f ? 1 : 0;
    EXPECT_GT(near, x.size() / 5);
}

TEST(Lidar, MeasuresTheHallWithNoiseAndDropouts) {
    const std::size_t count = test::fewer(3000, 3);
    const std::string room = fmt::format("lidar?points={}&beams=16&triangles=10000", count);
    const Mesh exact = make(room + "&noise_mm=0&dropout_percent=0").mesh;
    const Mesh noisy = make(room + "&noise_mm=20&dropout_percent=0").mesh;
    ASSERT_EQ(exact.vertices.size(), count);
    ASSERT_EQ(noisy.vertices.size(), count);
    double squares = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 d = noisy.vertices[i] - exact.vertices[i];
        squares += static_cast<double>(dot(d, d));
    }
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(count)), 0.02, 0.002);
    const Aabb hall = bounds_of(make("atrium?triangles=10000").mesh);
    for (const Vec3& p : exact.vertices) {
        const Vec3 slack{0.001f, 0.001f, 0.001f};
        EXPECT_TRUE(contains({hall.lo - slack, hall.hi + slack}, p));
    }
    EXPECT_EQ(make(room + "&dropout_percent=50").mesh.vertices.size(), count);
}

TEST(Lidar, ReportsAHallThatNothingHits) {
    const SceneTracer blind = [](const Mesh&, std::span<const Ray>, std::span<Hit>) {};
    EXPECT_THROW((void)make_builtin("lidar?points=10&triangles=10000", 1, blind),
                 std::runtime_error);
    EXPECT_THROW((void)make_builtin("lidar?points=10", 1, {}), std::invalid_argument);
}

}  // namespace
}  // namespace raydix
