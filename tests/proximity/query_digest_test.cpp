// Closest points, overlap, sweeps, insides and pairs of meshes in float and in double against
// digests kept here: the same bits for every tree, every number of threads and every processor.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/double3.h"
#include "support/digest_inputs.h"
#include "support/digests.h"
#include "support/double_scenes.h"
#include "support/scenes.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t query_digest_seed = 12;
constexpr std::size_t query_count = 800;

/// Today's calls in float. Those with the same names for both are called by name.
struct FloatCalls {
    using Number = float;
    using Point = Vec3;
    using Tree = Bvh;
    using Line = Segment;
    using Ball = Sphere;
    using Sweep = SphereSweep;
    using Body = Solid;
    using Limits = ClosestOptions;

    static Mesh mesh(const MeshD& mesh) { return in_float(mesh); }
    static Point point(Vec3d p) { return Double3(p).rounded(); }
    static std::vector<Ray> rays(const std::vector<RayD>& rays) { return in_float(rays); }
};

/// Today's calls in double.
struct DoubleCalls {
    using Number = double;
    using Point = Vec3d;
    using Tree = BvhD;
    using Line = SegmentD;
    using Ball = SphereD;
    using Sweep = SphereSweepD;
    using Body = SolidD;
    using Limits = ClosestOptionsD;

    static MeshD mesh(const MeshD& mesh) { return mesh; }
    static Point point(Vec3d p) { return p; }
    static std::vector<RayD> rays(const std::vector<RayD>& rays) { return rays; }
};

/// Needles, segments and points among triangles, and a few that are large.
MeshD with_degenerate() {
    RandomD random(query_digest_seed);
    const auto point = [&](double by) { return random.in({{-by, -by, -by}, {by, by, by}}); };
    MeshD mesh;
    const auto add = [&](Vec3d a, Vec3d b, Vec3d c) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
        mesh.triangles.push_back({first, first + 1, first + 2});
    };
    for (int i = 0; i < 60; ++i) {
        const Vec3d a = point(1), b = point(1), c = point(1), little = point(1e-6);
        const Vec3d middle = 0.5 * (a + b);
        add(a, b, middle);           // collinear up to rounding
        add(a, b, middle + little);  // a needle
        add(a, a + little, b);       // a blade
        add(a, b, b);                // a segment
        add(c, c, c);                // a point
        add(a, b, c);
    }
    for (int i = 0; i < 3; ++i) {
        const Vec3d a = point(4), b = point(4), c = point(4);
        add(a, b, c);
    }
    return mesh;
}

MeshD figure() { return in_double(small_builtin("builtin:figure?triangles=10000")); }

/// Without every tenth triangle: only winding numbers tell its inside.
MeshD torn(MeshD mesh) {
    std::vector<Triangle> kept;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        if (i % 10 != 0) kept.push_back(mesh.triangles[i]);
    mesh.triangles = std::move(kept);
    return mesh;
}

/// Every other triangle turned over: closed, but not oriented.
MeshD half_turned(MeshD mesh) {
    for (std::size_t i = 0; i < mesh.triangles.size(); i += 2)
        std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
    return mesh;
}

MeshD mesh_named(const std::string& name) {
    if (name == "figure") return figure();
    if (name == "torn figure") return torn(figure());
    if (name == "turned figure") return half_turned(figure());
    if (name == "far figure") {
        MeshD mesh = figure();
        for (Vec3d& p : mesh.vertices) p = (1.0 / 3.0) * p + utm_place;
        return mesh;
    }
    if (name == "lattice") return in_double(lattice_mesh(300, 5, query_digest_seed));
    return with_degenerate();
}

constexpr Builder builders[] = {Builder::karras, Builder::ploc, Builder::binned, Builder::split,
                                Builder::sbvh};

/// A mesh, trees of it, and what they are asked.
template <class Calls>
class Asked {
public:
    using Number = typename Calls::Number;
    using Point = typename Calls::Point;
    using Tree = typename Calls::Tree;
    struct NamedTree {
        std::string name;
        Tree tree;
    };

    explicit Asked(const std::string& name)
        : wide_(mesh_named(name)), box_(box_of_mesh(wide_)), torn_(name.starts_with("torn")) {
        const auto mesh = Calls::mesh(wide_);
        for (const Builder builder : builders)
            trees.push_back(
                {std::string(builder_name(builder)), build_bvh(mesh, {.builder = builder})});
        MeshD beside = thinned(wide_, 5);
        for (Vec3d& p : beside.vertices) p = p + 0.01 * (box_.hi - box_.lo);
        other = build_bvh(Calls::mesh(beside), {.builder = Builder::ploc});
        make_queries();
    }

    [[nodiscard]] Packed input() const {
        Packed packed;
        packed.add(wide_).add_all(points);
        for (const auto& line : lines) packed.add(line.a).add(line.b);
        for (const auto& ball : balls) packed.add(ball.center).add(ball.radius);
        for (const auto& sweep : sweeps) packed.add(sweep.path).add(sweep.radius);
        return packed;
    }
    /// A part of the mesh's size.
    [[nodiscard]] Number part(double of) const { return static_cast<Number>(of * extent()); }

    std::vector<NamedTree> trees;
    Tree other;  // a fifth of the triangles, a little beside
    std::vector<Point> points;
    std::vector<typename Calls::Line> lines;
    std::vector<typename Calls::Ball> balls;
    std::vector<typename Calls::Sweep> sweeps;

private:
    [[nodiscard]] double extent() const {
        const Vec3d size = box_.hi - box_.lo;
        return std::max({size.x, size.y, size.z});
    }
    /// In and near the box, at corners, near corners, and far away.
    void make_queries() {
        RandomD random(query_digest_seed);
        const auto beside = [&](double by) {
            return (by * extent()) * random.in({{-1, -1, -1}, {1, 1, 1}});
        };
        for (std::size_t i = 0; i < query_count / 4; ++i) {
            const Vec3d inside = random.in(box_), corner = a_corner(random),
                        near = corner + beside(0.01), far = inside + beside(100),
                        next = corner + beside(0.05);
            const double size = random.between(0, 0.03) * extent();
            for (const Vec3d p : {inside, near, far}) points.push_back(Calls::point(p));
            if (!torn_) points.push_back(Calls::point(corner));
            lines.push_back({Calls::point(corner), Calls::point(inside)});
            lines.push_back({Calls::point(near), Calls::point(next)});
            lines.push_back({Calls::point(corner), Calls::point(corner)});
            balls.push_back({Calls::point(near), static_cast<Number>(size)});
            balls.push_back({Calls::point(inside), static_cast<Number>(size)});
            balls.push_back({Calls::point(corner), Number{0}});
        }
        for (const auto& ray : Calls::rays(digest_rays(wide_, query_count, query_digest_seed)))
            sweeps.push_back({ray, static_cast<Number>(sweeps.size() % 5 == 0
                                                           ? 0.0
                                                           : random.between(0, 0.02) * extent())});
    }
    Vec3d a_corner(RandomD& random) const {
        const Triangle& t = wide_.triangles[random.below(wide_.triangles.size())];
        return wide_.vertices[t[random.below(3)]];
    }

    MeshD wide_;
    AabbD box_;
    bool torn_;  // at its corners winding numbers are close to 1/2: no place for a digest
};

template <class Points>
Answer points_answer(const Points& found) {
    Answer out;
    for (const auto& point : found) {
        out.values.add(point.distance).add(point.prim).add(point.u).add(point.v);
        out.values.add(point.position);
        out.found += point.found();
    }
    return out;
}

template <class Sweeps>
Answer sweeps_answer(const Sweeps& found) {
    Answer out;
    for (const auto& hit : found) {
        out.values.add_hit(hit).add(hit.position);
        out.found += hit.hit();
    }
    return out;
}

Answer flags_answer(const std::vector<std::uint8_t>& flags) {
    Answer out;
    out.values.add_all(flags);
    for (const std::uint8_t flag : flags) out.found += flag;
    return out;
}

Answer lists_answer(const OverlapLists& lists) {
    Answer out;
    out.values.add_all(lists.prims);
    out.where.add_all(lists.offsets);
    out.found = lists.prims.size();
    return out;
}

/// A list that is empty where nothing touches, which the flags say too.
Answer flags_of_lists(const OverlapLists& lists) {
    std::vector<std::uint8_t> flags;
    for (std::size_t i = 0; i + 1 < lists.offsets.size(); ++i)
        flags.push_back(lists.offsets[i] != lists.offsets[i + 1]);
    return flags_answer(flags);
}

Answer pairs_answer(const std::vector<PrimitivePair>& pairs, std::uint64_t count) {
    Answer out;
    for (const PrimitivePair& pair : pairs) out.values.add(pair.first).add(pair.second);
    out.where.add(count);
    out.found = pairs.size();
    return out;
}

template <class Numbers>
Answer distances_answer(const Numbers& distances) {
    Answer out;
    out.values.add_all(distances);
    for (const auto distance : distances) out.found += distance < 0;
    return out;
}

/// Answers of one call on one tree.
template <class Calls>
struct Call {
    using Data = Asked<Calls>;
    using Tree = typename Calls::Tree;

    const Data& data;
    const Tree& tree;
    int threads;

    [[nodiscard]] Answer closest(typename Calls::Number most) const {
        return points_answer(closest_points(tree, data.points, {most, threads}));
    }
    template <class Queries>
    [[nodiscard]] Answer touch(const Queries& queries) const {
        std::vector<std::uint8_t> touched(queries.size());
        touch_any(tree, queries, touched, {.threads = threads});
        return flags_answer(touched);
    }
    template <class Queries>
    [[nodiscard]] OverlapLists touch_lists(const Queries& queries) const {
        return touch_all(tree, queries, {.threads = threads});
    }
    [[nodiscard]] Answer sweep() const {
        return sweeps_answer(sweep_spheres(tree, data.sweeps, {.threads = threads}));
    }
    [[nodiscard]] Answer pairs(bool narrow) const {
        const PairOptions options{.narrow = narrow, .threads = threads};
        return pairs_answer(overlapping_pairs(tree, options),
                            count_overlapping_pairs(tree, options));
    }
    [[nodiscard]] Answer pairs_between(bool narrow) const {
        const PairOptions options{.narrow = narrow, .threads = threads};
        return pairs_answer(overlapping_pairs(tree, data.other, options),
                            count_overlapping_pairs(tree, data.other, options));
    }
    [[nodiscard]] Answer inside() const {
        std::vector<std::uint8_t> flags(data.points.size());
        contains(typename Calls::Body(tree, {.threads = threads}), data.points, flags, threads);
        return flags_answer(flags);
    }
    [[nodiscard]] Answer distances(typename Calls::Number most) const {
        return distances_answer(signed_distances(typename Calls::Body(tree, {.threads = threads}),
                                                 data.points, {most, threads}));
    }
    /// Whole numbers: of meshes that are closed.
    [[nodiscard]] Answer winding() const {
        const auto numbers =
            winding_numbers(typename Calls::Body(tree, {.threads = threads}), data.points, threads);
        Answer out;
        out.values.add_all(numbers);
        for (const double number : numbers) out.found += number != 0.0;
        return out;
    }
};

/// The same answers by calls for one query each.
template <class Calls>
struct OneByOne {
    const Asked<Calls>& data;
    const typename Calls::Tree& tree;

    template <class Queries, class One>
    static auto each(const Queries& queries, const One& one) {
        std::vector<decltype(one(queries[0]))> out;
        for (const auto& query : queries) out.push_back(one(query));
        return out;
    }
    [[nodiscard]] Answer closest(typename Calls::Number most) const {
        return points_answer(
            each(data.points, [&](const auto& p) { return closest_point(tree, p, most); }));
    }
    template <class Queries>
    [[nodiscard]] Answer touch(const Queries& queries) const {
        return flags_answer(each(
            queries, [&](const auto& q) { return static_cast<std::uint8_t>(touches(tree, q)); }));
    }
    [[nodiscard]] Answer sweep() const {
        return sweeps_answer(
            each(data.sweeps, [&](const auto& s) { return sweep_sphere(tree, s); }));
    }
    [[nodiscard]] Answer inside() const {
        const typename Calls::Body body(tree);
        return flags_answer(each(data.points, [&](const auto& p) {
            return static_cast<std::uint8_t>(contains(body, p));
        }));
    }
    [[nodiscard]] Answer distances() const {
        const typename Calls::Body body(tree);
        return distances_answer(
            each(data.points, [&](const auto& p) { return signed_distance(body, p); }));
    }
};

/// `query` by one call on a tree.
template <class Calls>
Answer answer_of(const std::string& query, const Call<Calls>& call) {
    const auto& data = call.data;
    const auto unlimited = std::numeric_limits<typename Calls::Number>::infinity();
    if (query == "closest") return call.closest(unlimited);
    if (query == "closest within") return call.closest(data.part(0.02));
    if (query == "lines touch") return call.touch(data.lines);
    if (query == "lines touch all") return lists_answer(call.touch_lists(data.lines));
    if (query == "balls touch") return call.touch(data.balls);
    if (query == "balls touch all") return lists_answer(call.touch_lists(data.balls));
    if (query == "sweep") return call.sweep();
    if (query == "pairs") return call.pairs(false);
    if (query == "pairs, narrow") return call.pairs(true);
    if (query == "pairs of two") return call.pairs_between(false);
    if (query == "pairs of two, narrow") return call.pairs_between(true);
    if (query == "inside") return call.inside();
    if (query == "signed distance") return call.distances(unlimited);
    if (query == "signed distance within") return call.distances(data.part(0.02));
    if (query == "winding") return call.winding();
    throw std::invalid_argument("no query " + query);
}

/// Queries that can be asked in another way than by a batch.
template <class Calls>
void add_other_ways(Question& question, const std::string& query,
                    std::shared_ptr<Asked<Calls>> asked) {
    const auto add = [&](const char* name, auto answer) {
        question.ways.push_back({name, [asked, answer] {
                                     return answer(OneByOne<Calls>{*asked, asked->trees[1].tree});
                                 }});
    };
    const auto unlimited = std::numeric_limits<typename Calls::Number>::infinity();
    const auto most = query == "closest" ? unlimited : asked->part(0.02);
    if (query.starts_with("closest"))
        add("one by one", [=](auto one) { return one.closest(most); });
    if (query == "lines touch")
        add("one by one", [](auto one) { return one.touch(one.data.lines); });
    if (query == "balls touch")
        add("one by one", [](auto one) { return one.touch(one.data.balls); });
    if (query == "lines touch")
        add("lists", [](auto one) { return flags_of_lists(touch_all(one.tree, one.data.lines)); });
    if (query == "balls touch")
        add("lists", [](auto one) { return flags_of_lists(touch_all(one.tree, one.data.balls)); });
    if (query == "sweep") add("one by one", [](auto one) { return one.sweep(); });
    if (query == "inside") add("one by one", [](auto one) { return one.inside(); });
    if (query == "signed distance") add("one by one", [](auto one) { return one.distances(); });
}

template <class Calls>
Question question_of(const std::string& mesh, const std::string& query) {
    const auto asked = std::make_shared<Asked<Calls>>(mesh);
    Question question{asked->input(), 30, {}};
    for (const auto& named : asked->trees)
        for (const int threads : {1, 2})
            question.ways.push_back(
                {fmt::format("{}, {} threads", named.name, threads),
                 [asked, query, threads, tree = &named.tree] {
                     return answer_of(query, Call<Calls>{*asked, *tree, threads});
                 }});
    add_other_ways(question, query, asked);
    return question;
}

Question ask(const std::string& scene, const std::string& query) {
    const std::string mesh = scene.substr(scene.find(' ') + 1);
    return scene.starts_with("float") ? question_of<FloatCalls>(mesh, query)
                                      : question_of<DoubleCalls>(mesh, query);
}

constexpr Known known[] = {
    {"float figure", "closest", "e4483db60bc3bf09", "c274cd2ae167b094", "-"},
    {"float figure", "closest within", "e4483db60bc3bf09", "9c736c43d350f739", "-"},
    {"float figure", "lines touch", "e4483db60bc3bf09", "a27c6eec3220db17", "-"},
    {"float figure", "lines touch all", "e4483db60bc3bf09", "7af301a7c8a92c2b", "a9e0e7dcad4833fe"},
    {"float figure", "balls touch", "e4483db60bc3bf09", "2138133b975136e7", "-"},
    {"float figure", "balls touch all", "e4483db60bc3bf09", "2ecc150fb8604a48", "399d5ba8b2a55c24"},
    {"float figure", "sweep", "e4483db60bc3bf09", "ca361364c363ebda", "-"},
    {"float figure", "pairs", "e4483db60bc3bf09", "8f00c1098b6172b6", "bd0b59e21abcd197"},
    {"float figure", "pairs of two", "e4483db60bc3bf09", "4c5f919aefb32582", "03df6bbe3415a02b"},
    {"float figure", "pairs of two, narrow", "e4483db60bc3bf09", "87e0bbdbfbcc8822",
     "865599b1785d130c"},
    {"float lattice", "closest", "b17547c90a07c3cf", "14ab772f0f6a96a3", "-"},
    {"float lattice", "closest within", "b17547c90a07c3cf", "65514dd19a3f6a38", "-"},
    {"float lattice", "lines touch", "b17547c90a07c3cf", "17108db94e54ec81", "-"},
    {"float lattice", "lines touch all", "b17547c90a07c3cf", "d1884834b638c729",
     "44ce4e35fe00d7b3"},
    {"float lattice", "balls touch", "b17547c90a07c3cf", "31904db16da6ab3e", "-"},
    {"float lattice", "balls touch all", "b17547c90a07c3cf", "d1ee2caaf7685e3f",
     "b9d5f03b4f034150"},
    {"float lattice", "sweep", "b17547c90a07c3cf", "dfccccf7ac4f92fe", "-"},
    {"float lattice", "pairs", "b17547c90a07c3cf", "5d16afaa1d823fc6", "29f7bde5b5c111c3"},
    {"float lattice", "pairs, narrow", "b17547c90a07c3cf", "32551db34cefd2c4", "317a5bd22bdac283"},
    {"float lattice", "pairs of two", "b17547c90a07c3cf", "b7268852fe008606", "1a2de254eb37afe7"},
    {"float lattice", "pairs of two, narrow", "b17547c90a07c3cf", "03401ab71d438a7b",
     "caa757636c662d8d"},
    {"float degenerate", "closest", "2c9f4cfd297cab9f", "fa66c15f3c21cee1", "-"},
    {"float degenerate", "closest within", "2c9f4cfd297cab9f", "dd0dc92084883a59", "-"},
    {"float degenerate", "lines touch", "2c9f4cfd297cab9f", "c1e2a013ef251469", "-"},
    {"float degenerate", "lines touch all", "2c9f4cfd297cab9f", "15e9ee57b2ae6ee2",
     "64dd7af4730b8db8"},
    {"float degenerate", "balls touch", "2c9f4cfd297cab9f", "215bd32733952d24", "-"},
    {"float degenerate", "balls touch all", "2c9f4cfd297cab9f", "52893bd9937f4eb6",
     "1fb527d140a612f7"},
    {"float degenerate", "sweep", "2c9f4cfd297cab9f", "733458c0fff55dd8", "-"},
    {"float degenerate", "pairs", "2c9f4cfd297cab9f", "85984f831e947b44", "35f3ced7ffc23568"},
    {"float degenerate", "pairs, narrow", "2c9f4cfd297cab9f", "262b2e46a36a8409",
     "b6314bdb4cebccbb"},
    {"float degenerate", "pairs of two", "2c9f4cfd297cab9f", "349f5d151fb6a08e",
     "6a4b0f80282b4b7b"},
    {"float degenerate", "pairs of two, narrow", "2c9f4cfd297cab9f", "4dad52d56222d51b",
     "01c92167adaccc91"},
    {"float figure", "inside", "e4483db60bc3bf09", "bab04e0860aa9e6f", "-"},
    {"float figure", "signed distance", "e4483db60bc3bf09", "b329765350116b16", "-"},
    {"float figure", "signed distance within", "e4483db60bc3bf09", "dee1ccbcd6661ba6", "-"},
    {"float figure", "winding", "e4483db60bc3bf09", "bde7fcf9f52c15af", "-"},
    {"float turned figure", "inside", "d2bca11244b5ae08", "71807d13fa571190", "-"},
    {"float turned figure", "winding", "d2bca11244b5ae08", "ee2e82cee7723089", "-"},
    {"float torn figure", "inside", "4a1afdc364b70e86", "a86c3934465f1e14", "-"},
    {"double far figure", "closest", "41d36e138069cf73", "834513982578a296", "-"},
    {"double far figure", "closest within", "41d36e138069cf73", "43f9a6665c5ca8c0", "-"},
    {"double far figure", "lines touch", "41d36e138069cf73", "a27c6eec3220db17", "-"},
    {"double far figure", "lines touch all", "41d36e138069cf73", "7af301a7c8a92c2b",
     "a9e0e7dcad4833fe"},
    {"double far figure", "balls touch", "41d36e138069cf73", "2138133b975136e7", "-"},
    {"double far figure", "balls touch all", "41d36e138069cf73", "2ecc150fb8604a48",
     "399d5ba8b2a55c24"},
    {"double far figure", "sweep", "41d36e138069cf73", "1091bffa33e48a29", "-"},
    {"double far figure", "pairs", "41d36e138069cf73", "8f00c1098b6172b6", "bd0b59e21abcd197"},
    {"double far figure", "pairs of two", "41d36e138069cf73", "4c5f919aefb32582",
     "03df6bbe3415a02b"},
    {"double far figure", "pairs of two, narrow", "41d36e138069cf73", "87e0bbdbfbcc8822",
     "865599b1785d130c"},
    {"double lattice", "closest", "ea7ad16bf61c839d", "65b53d39e972d062", "-"},
    {"double lattice", "closest within", "ea7ad16bf61c839d", "618726327a414b9c", "-"},
    {"double lattice", "lines touch", "ea7ad16bf61c839d", "17108db94e54ec81", "-"},
    {"double lattice", "lines touch all", "ea7ad16bf61c839d", "d1884834b638c729",
     "44ce4e35fe00d7b3"},
    {"double lattice", "balls touch", "ea7ad16bf61c839d", "31904db16da6ab3e", "-"},
    {"double lattice", "balls touch all", "ea7ad16bf61c839d", "92c169c125595f2e",
     "c648212e0191f02f"},
    {"double lattice", "sweep", "ea7ad16bf61c839d", "24aacee9bf1a8549", "-"},
    {"double lattice", "pairs", "ea7ad16bf61c839d", "5d16afaa1d823fc6", "29f7bde5b5c111c3"},
    {"double lattice", "pairs, narrow", "ea7ad16bf61c839d", "32551db34cefd2c4", "317a5bd22bdac283"},
    {"double lattice", "pairs of two", "ea7ad16bf61c839d", "b7268852fe008606", "1a2de254eb37afe7"},
    {"double lattice", "pairs of two, narrow", "ea7ad16bf61c839d", "c39650cebc167fe0",
     "8347f90d324e24f2"},
    {"double degenerate", "closest", "49b7f407944a03b0", "2b14b44a529e140e", "-"},
    {"double degenerate", "closest within", "49b7f407944a03b0", "de6c3be6f2879a5b", "-"},
    {"double degenerate", "lines touch", "49b7f407944a03b0", "c1e2a013ef251469", "-"},
    {"double degenerate", "lines touch all", "49b7f407944a03b0", "5c391cd521ed8069",
     "4e0c2242b5616ad3"},
    {"double degenerate", "balls touch", "49b7f407944a03b0", "7fdb4b44e6a72574", "-"},
    {"double degenerate", "balls touch all", "49b7f407944a03b0", "8572becb7717c912",
     "4fec6690063bfe7b"},
    {"double degenerate", "sweep", "49b7f407944a03b0", "d971f65be62bc5d1", "-"},
    {"double degenerate", "pairs", "49b7f407944a03b0", "85984f831e947b44", "35f3ced7ffc23568"},
    {"double degenerate", "pairs, narrow", "49b7f407944a03b0", "262b2e46a36a8409",
     "b6314bdb4cebccbb"},
    {"double degenerate", "pairs of two", "49b7f407944a03b0", "349f5d151fb6a08e",
     "6a4b0f80282b4b7b"},
    {"double degenerate", "pairs of two, narrow", "49b7f407944a03b0", "4dad52d56222d51b",
     "01c92167adaccc91"},
    {"double far figure", "inside", "41d36e138069cf73", "bab04e0860aa9e6f", "-"},
    {"double far figure", "signed distance", "41d36e138069cf73", "5368d6e6c02e57ff", "-"},
    {"double far figure", "signed distance within", "41d36e138069cf73", "6d0cb727b282e008", "-"},
    {"double far figure", "winding", "41d36e138069cf73", "bde7fcf9f52c15af", "-"},
    {"double turned figure", "inside", "7c3c3704aad6bbbe", "71807d13fa571190", "-"},
    {"double turned figure", "winding", "7c3c3704aad6bbbe", "ee2e82cee7723089", "-"},
    {"double torn figure", "inside", "bb4d752d30350d03", "a86c3934465f1e14", "-"},
};

/// Sums of angles differ in their last bits between trees and machines. Insides of the torn figure
/// do not, since no query is where that could decide.
template <class Calls>
void expect_clear_insides() {
    const Asked<Calls> asked("torn figure");
    const typename Calls::Body body(asked.trees[0].tree);
    ASSERT_EQ(body.rule(), InsideRule::winding);
    double closest = 1.0;
    for (const double number : winding_numbers(body, asked.points))
        closest = std::min(closest, std::abs(std::abs(number) - 0.5));
    EXPECT_GT(closest, 1e-6);
}

TEST(QueryDigestInput, TornFigureHasClearInsides) {
    expect_clear_insides<FloatCalls>();
    expect_clear_insides<DoubleCalls>();
}

class QueryDigest : public testing::TestWithParam<Known> {};

TEST_P(QueryDigest, IsKnown) { expect_known(GetParam(), ask(GetParam().scene, GetParam().query)); }

INSTANTIATE_TEST_SUITE_P(Meshes, QueryDigest, testing::ValuesIn(known),
                         [](const auto& row) { return name_of(row.param); });

}  // namespace
}  // namespace raydix::test
