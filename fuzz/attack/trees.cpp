// Binary trees: invariants, the same tree for every thread count, for each builder of the LBVH
// family and from kept memory; trees over boxes and points; wide trees from both roads.
#include <raydix/bvh.h>
#include <raydix/check.h>
#include <raydix/cwbvh.h>
#include <raydix/wide.h>

#include "attack/attack.h"
#include "attack/parts.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

class TreeDuel {
public:
    explicit TreeDuel(Case& c)
        : case_(c), made_(any_mesh(c.random, c.random.chance(0.1) ? 1200 : 60)) {
        valid_ = valid_triangles(made_.mesh).size();
    }

    void run() {
        for (const BuildOptions& options : every_builder(case_.random)) one_builder(options);
        lbvh_family();
        other_primitives();
        many();
    }

private:
    void one_builder(const BuildOptions& options) {
        const Bvh tree = build_bvh(made_.mesh, options);
        const CheckReport report = check(tree, made_.mesh);
        expect(report.ok, "check", options, report.broken);
        expect(tree.input_count() == made_.mesh.triangles.size() &&
                   tree.left_out() == made_.mesh.triangles.size() - valid_,
               "left_out", options);
        BuildOptions other = options;
        other.threads = options.threads == 1 ? case_.random.whole(2, 4) : 1;
        Bvh again = build_bvh(made_.mesh, other);
        expect(tree_hash(tree) == tree_hash(again), "tree_hash with other threads", options);
        builder_.build(made_.mesh, other, again);
        const CheckReport same = check_same(tree, again);
        expect(same.ok, "BvhBuilder in kept memory", options, same.broken);
        const TreeStats stats = tree_stats(tree, {.with_epo = valid_ < 100, .threads = 1});
        expect(stats.tree_hash == tree_hash(tree) && stats.leaves == tree.leaf_count() &&
                   stats.max_depth == tree.max_depth() && stats.references == tree.order().size() &&
                   (!stats.depth_bound || stats.max_depth <= *stats.depth_bound),
               "tree_stats", options);
        wide(tree, options);
    }

    void wide(const Bvh& tree, const BuildOptions& options) {
        const WideBvhOptions wanted{.width = case_.random.chance(0.5) ? 8 : 4,
                                    .compact = case_.random.chance(0.5),
                                    .threads = case_.random.whole(1, 2)};
        const WideBvh from_binary(tree, wanted);
        WideBvh direct;
        wide_builder_.build(made_.mesh, options, direct, wanted);
        // Straight from sorted triangles nodes may be others; they are the same with other threads.
        const bool straight = options.builder == Builder::apetrei && options.max_leaf == 4 &&
                              options.reinsertion_rounds == 0 && !wanted.compact;
        if (straight)
            expect_same(on_other_threads(options, wanted), direct, "wide trees", options);
        else
            expect_same(from_binary, direct, "wide trees from both roads", options);
        const WideBvhStats &a = from_binary.stats(), &b = direct.stats();
        expect(a.references == b.references && a.left_out == b.left_out,
               "triangles of wide trees from both roads", options);
        const CwbvhStats compressed = Cwbvh(tree, 1).stats();
        expect(compressed.triangles <= valid_ && compressed.references >= compressed.triangles,
               "Cwbvh stats", options);
    }

    [[nodiscard]] WideBvh on_other_threads(BuildOptions options, const WideBvhOptions& wanted) {
        options.threads = options.threads == 1 ? 3 : 1;
        return build_wide_bvh(made_.mesh, options, wanted);
    }
    void expect_same(const WideBvh& one, const WideBvh& other, const char* what,
                     const BuildOptions& options) {
        const WideBvhStats &a = one.stats(), &b = other.stats();
        expect(a.nodes == b.nodes && a.leaves == b.leaves && a.references == b.references &&
                   a.max_depth == b.max_depth && a.bytes == b.bytes && a.sah == b.sah &&
                   a.widening == b.widening && a.left_out == b.left_out,
               what, options);
    }

    void lbvh_family() {
        BuildOptions options = any_build_options(case_.random);
        options.builder = Builder::karras;
        const Bvh karras = build_bvh(made_.mesh, options);
        for (const Builder builder : {Builder::lauterbach, Builder::garanzha, Builder::apetrei}) {
            options.builder = builder;
            const CheckReport same = check_same(karras, build_bvh(made_.mesh, options));
            expect(same.ok, "LBVH builders give the same tree", options, same.broken);
        }
    }

    void other_primitives() {
        std::vector<Aabb> boxes;
        for (std::size_t i = 0; i + 1 < made_.mesh.vertices.size(); i += 2) {
            Aabb box{made_.mesh.vertices[i], made_.mesh.vertices[i + 1]};
            if (case_.random.chance(0.9))
                for (std::uint32_t axis = 0; axis < 3; ++axis)
                    if (at(box.lo, axis) > at(box.hi, axis))
                        std::swap(at(box.lo, axis), at(box.hi, axis));
            boxes.push_back(box);
        }
        for (const BuildOptions& options : every_builder(case_.random)) {
            const Bvh over_boxes = build_bvh(std::span<const Aabb>(boxes), options);
            const CheckReport of_boxes = check(over_boxes);
            expect(of_boxes.ok, "check over boxes", options, of_boxes.broken);
            const Bvh over_points = build_bvh(std::span<const Vec3>(made_.mesh.vertices), options);
            const CheckReport of_points = check(over_points);
            expect(of_points.ok, "check over points", options, of_points.broken);
        }
    }

    void many() {
        std::vector<TestMesh> meshes;
        std::vector<MeshView> views;
        for (int i = 0; i < 4; ++i) meshes.push_back(any_mesh(case_.random, 20));
        for (const TestMesh& mesh : meshes) views.push_back(mesh.mesh);
        BuildOptions options = any_build_options(case_.random);
        const std::vector<Bvh> trees = build_many(views, options);
        for (std::size_t i = 0; i < trees.size(); ++i) {
            const CheckReport same = check_same(trees[i], build_bvh(views[i], options));
            expect(same.ok, "build_many", options, same.broken);
        }
    }

    void expect(bool right, const char* what, const BuildOptions& options,
                const std::string& detail = {}) {
        case_.expect(right, "trees",
                     text("%s, %s", what, std::string(builder_name(options.builder)).c_str()), [&] {
                         return "    " + text_of(options) +
                                text(", family %s\n    ", family_name(made_.family)) + detail +
                                "\n" + text_of(made_.mesh);
                     });
    }

    Case& case_;
    TestMesh made_;
    std::size_t valid_ = 0;
    BvhBuilder builder_;
    WideBvhBuilder wide_builder_;
};

}  // namespace

static void attack_trees(Case& c) { TreeDuel(c).run(); }

static const Kind trees_kind("trees", attack_trees, 1);

}  // namespace raydix::attack
