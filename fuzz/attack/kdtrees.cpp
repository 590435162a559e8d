// k-d trees: their invariants, and nearest points against all points one by one. Their rays are
// part of the kind `rays`.
#include <raydix/kdtree.h>

#include <algorithm>

#include "attack/attack.h"
#include "attack/precision.h"

namespace raydix::attack {

static void attack_kdtrees(Case& c) {
    const TestMesh made = any_mesh(c.random, c.random.chance(0.1) ? 600 : 60);
    KdTreeOptions options;
    options.bits = c.random.chance(0.3) ? 30 : 63;
    options.max_leaf = c.random.whole(0, 12);
    options.threads = 1;
    const auto expect = [&](bool right, const char* what, const std::string& detail = {}) {
        c.expect(right, "kdtrees", what, [&] {
            return text("    family %s, bits %d, max_leaf %d\n    ", family_name(made.family),
                        options.bits, options.max_leaf) +
                   detail + "\n" + text_of(made.mesh);
        });
    };
    const KdTree over_triangles = build_kdtree(made.mesh, options);
    const CheckReport triangles = kd_check(over_triangles, made.mesh);
    expect(triangles.ok, "kd_check over triangles", triangles.broken);
    const std::span<const Vec3> points = made.mesh.vertices;
    const KdTree tree = build_kdtree(points, options);
    const CheckReport report = kd_check(tree);
    expect(report.ok, "kd_check over points", report.broken);
    const std::string hash = kd_hash(tree);
    options.threads = 3;
    expect(hash == kd_hash(build_kdtree(points, options)), "kd_hash with other threads");

    const Aabb bounds = finite_bounds(made.mesh);
    std::vector<Vec3> queries;
    for (int i = 0; i < 40; ++i)
        queries.push_back(c.random.chance(0.3) ? points[c.random.below(points.size())]
                                               : make_point(c.random, made.mesh, bounds));
    const std::uint32_t k = 1 + c.random.below(20);
    const std::vector<KdNeighbor> rows = kd_nearest(tree, queries, k, {.threads = 1});
    for (std::size_t q = 0; q < queries.size(); ++q) {
        std::vector<KdNeighbor> wanted;
        if (is_finite(queries[q]))
            for (const std::uint32_t id : tree.order())
                wanted.push_back({distance_squared(queries[q], points[id]), id});
        std::sort(wanted.begin(), wanted.end(), [](const KdNeighbor& a, const KdNeighbor& b) {
            return a.d2 != b.d2 ? a.d2 < b.d2 : a.point < b.point;
        });
        wanted.resize(k);
        bool right = true;
        for (std::size_t j = 0; j < k; ++j)
            right = right && rows[q * k + j].d2 == wanted[j].d2 &&
                    rows[q * k + j].point == wanted[j].point;
        expect(right, "kd_nearest", text_of(queries[q]) + text(" k %u", k));
    }
}

static const Kind kdtrees_kind("kdtrees", attack_kdtrees, 0.5);

}  // namespace raydix::attack
