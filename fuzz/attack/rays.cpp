// Rays through every tree by every path against brute force: closest, any and all hits, bit for
// bit.
#include <raydix/cwbvh.h>
#include <raydix/kdtree.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <optional>

#include "attack/attack.h"
#include "attack/brute_all.h"
#include "attack/ray_families.h"
#include "support/cwbvh_trace.h"

namespace raydix::attack {
namespace {

enum class Mode : std::uint32_t { closest, any, all };
constexpr const char* mode_names[] = {"closest", "any", "all"};

/// The answers by brute force.
struct Expected {
    std::vector<Hit> closest;
    std::vector<std::uint8_t> any;
    AllHits all;
};
Expected expect_of(const Mesh& mesh, std::span<const Ray> rays) {
    Expected made{trace_brute_force(mesh, rays, 1), {}, brute_all(mesh, rays)};
    for (const Hit& hit : made.closest) made.any.push_back(hit.hit());
    return made;
}

/// Which tree is asked, and how.
struct Way {
    enum class Tree : std::uint32_t {
        binary,
        single,
        wide,
        direct_wide,
        wide_single,
        cwbvh,
        kdtree
    };
    Tree tree = Tree::binary;
    BuildOptions build{};
    WideBvhOptions wide{};
    KdTreeOptions kd{};
    TraceOptions trace{};
};
constexpr const char* tree_names[] = {"binary",      "binary single", "wide",  "direct wide",
                                      "wide single", "cwbvh",         "kdtree"};
bool is_wide(const Way& way) {
    return way.tree == Way::Tree::wide || way.tree == Way::Tree::direct_wide ||
           way.tree == Way::Tree::wide_single;
}
bool takes_paths(const Way& way) {
    return way.tree == Way::Tree::wide || way.tree == Way::Tree::direct_wide;
}
/// One sort of finding for all builders and widths: faults are mostly shared.
const char* family_of(const Way& way) {
    return is_wide(way)                    ? "wide"
           : way.tree == Way::Tree::single ? "binary"
                                           : tree_names[std::size_t(way.tree)];
}
std::string layout_of(const Way& way) {
    std::string name = tree_names[std::size_t(way.tree)];
    if (is_wide(way)) name += text("%d%s", way.wide.width, way.wide.compact ? " compact" : "");
    return name;
}

/// What a tree answered; vectors are kept from batch to batch.
struct Answers {
    std::vector<Hit> closest;
    std::vector<std::uint8_t> any;
    AllHits all;

    void make_room(std::size_t rays) {
        closest.resize(rays);
        any.resize(rays);
    }
};

template <class Tree>
void ask_batch(const Tree& tree, std::span<const Ray> rays, Mode mode, const TraceOptions& options,
               Answers& answers) {
    if (mode == Mode::closest) trace(tree, rays, answers.closest, options);
    if (mode == Mode::any) trace_any(tree, rays, answers.any, options);
    if constexpr (!std::is_same_v<Tree, Cwbvh>)
        if (mode == Mode::all) answers.all = trace_all(tree, rays, options);
}
void ask_batch(const KdTree& tree, std::span<const Ray> rays, Mode mode,
               const TraceOptions& options, Answers& answers) {
    if (mode == Mode::closest) kd_trace(tree, rays, answers.closest, options);
    if (mode == Mode::any) kd_trace_any(tree, rays, answers.any, options);
}
template <class Tree>
void ask_singles(const Tree& tree, std::span<const Ray> rays, Mode mode, Answers& answers) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (mode == Mode::closest) answers.closest[i] = closest_hit(tree, rays[i]);
        if (mode == Mode::any) answers.any[i] = any_hit(tree, rays[i]);
    }
}

/// Trees of one mesh by one builder, made when they are first asked for.
class Trees {
public:
    explicit Trees(const Mesh& mesh) : mesh_(mesh) {}

    void use(const BuildOptions& options) {
        build_ = options;
        binary_ = build_bvh(mesh_, options);
    }
    const Bvh& binary() const { return binary_; }
    void use_wide(const Way& way) {
        wide_ = way.tree == Way::Tree::direct_wide ? build_wide_bvh(mesh_, build_, way.wide)
                                                   : WideBvh(binary_, way.wide);
    }
    const WideBvh& wide() const { return wide_; }

    void ask(const Way& way, std::span<const Ray> rays, Mode mode, Answers& answers) const {
        answers.make_room(rays.size());
        switch (way.tree) {
            case Way::Tree::binary:
                return ask_batch(binary_, rays, mode, way.trace, answers);
            case Way::Tree::single:
                return ask_singles(binary_, rays, mode, answers);
            case Way::Tree::wide:
            case Way::Tree::direct_wide:
                return ask_batch(wide_, rays, mode, way.trace, answers);
            case Way::Tree::wide_single:
                return ask_singles(wide_, rays, mode, answers);
            case Way::Tree::cwbvh:
                return ask_batch(Cwbvh(binary_, 1), rays, mode, way.trace, answers);
            case Way::Tree::kdtree:
                return ask_batch(build_kdtree(mesh_, way.kd), rays, mode, way.trace, answers);
        }
    }

private:
    const Mesh& mesh_;
    BuildOptions build_;
    Bvh binary_;
    WideBvh wide_;
};

std::span<const Hit> row(const AllHits& all, std::size_t i) {
    return std::span(all.hits).subspan(all.offsets[i], all.offsets[i + 1] - all.offsets[i]);
}

/// The first ray that is answered wrongly, if any.
std::optional<std::size_t> first_wrong(const Expected& expected, const Answers& answers, Mode mode,
                                       std::size_t rays) {
    const auto search = [&](const auto& is_right) -> std::optional<std::size_t> {
        for (std::size_t i = 0; i < rays; ++i)
            if (!is_right(i)) return i;
        return std::nullopt;
    };
    switch (mode) {
        case Mode::closest:
            if (same_bytes(expected.closest, answers.closest)) return std::nullopt;
            return search([&](std::size_t i) {
                return std::memcmp(&expected.closest[i], &answers.closest[i], sizeof(Hit)) == 0;
            });
        case Mode::any:
            if (same_bytes(expected.any, answers.any)) return std::nullopt;
            return search([&](std::size_t i) { return expected.any[i] == answers.any[i]; });
        default:
            if (same_bytes(expected.all.hits, answers.all.hits) &&
                same_bytes(expected.all.offsets, answers.all.offsets))
                return std::nullopt;
            return search([&](std::size_t i) {
                return same_bytes(row(expected.all, i), row(answers.all, i));
            });
    }
}

std::string difference(const Expected& expected, const Answers& answers, Mode mode,
                       std::size_t ray) {
    switch (mode) {
        case Mode::closest:
            return "    brute force " + text_of(expected.closest[ray]) + "\n    the tree    " +
                   text_of(answers.closest[ray]) + "\n";
        case Mode::any:
            return text("    brute force %d, the tree %d\n", expected.any[ray], answers.any[ray]);
        default: {
            std::string made;
            for (const Hit& hit : row(expected.all, ray))
                made += "    brute force " + text_of(hit) + "\n";
            for (const Hit& hit : row(answers.all, ray))
                made += "    the tree    " + text_of(hit) + "\n";
            return made;
        }
    }
}

/// In a word or two, how the answer is wrong.
const char* sort_of(const Expected& expected, const Answers& answers, Mode mode, std::size_t ray) {
    if (mode == Mode::any) return expected.any[ray] != 0 ? "lost" : "invented";
    if (mode == Mode::all) {
        const std::size_t wanted = row(expected.all, ray).size(),
                          got = row(answers.all, ray).size();
        return got < wanted ? "lost" : got > wanted ? "invented" : "another";
    }
    const bool wanted = expected.closest[ray].hit(), got = answers.closest[ray].hit();
    return wanted && !got ? "lost" : got && !wanted ? "invented" : "another";
}

const char* limits_of(const Ray& ray) {
    return ray.tmin > 0 ? "tmin" : ray.tmax < infinity ? "tmax" : "no limits";
}

/// Whether `way` answers these rays wrongly on this mesh.
bool fails(const Mesh& mesh, std::span<const Ray> rays, const Way& way, Mode mode,
           std::string* how) {
    const Expected expected = expect_of(mesh, rays);
    Trees trees(mesh);
    trees.use(way.build);
    if (is_wide(way)) trees.use_wide(way);
    Answers answers;
    trees.ask(way, rays, mode, answers);
    const std::optional<std::size_t> wrong = first_wrong(expected, answers, mode, rays.size());
    if (wrong && how) *how = text_of(rays[*wrong]) + difference(expected, answers, mode, *wrong);
    return wrong.has_value();
}

std::string reproducer(const TestMesh& made, std::span<const Ray> rays, std::size_t wrong,
                       const Way& way, Mode mode) {
    // One ray alone if that is enough to fail; some paths need its neighbours.
    const std::span<const Ray> alone = rays.subspan(wrong, 1);
    const bool neighbours = !fails(made.mesh, alone, way, mode, nullptr);
    const std::span<const Ray> needed = neighbours ? rays : alone;
    const Mesh least =
        minimise(made.mesh, [&](const Mesh& m) { return fails(m, needed, way, mode, nullptr); });
    std::string how;
    if (!fails(least, needed, way, mode, &how)) how = "    (not again)\n";
    std::string head =
        text("    %s, %s, path %s, isa %s, family %s%s\n    ", layout_of(way).c_str(),
             mode_names[std::size_t(mode)], std::string(simd_path_name(way.trace.path)).c_str(),
             way.trace.isa.c_str(), family_name(made.family),
             neighbours ? text(", in a batch of %zu", rays.size()).c_str() : "");
    return head + text_of(way.build) + "\n" + text_of(least) + how;
}

/// One mesh, one batch of rays, and what they must give.
class Duel {
public:
    Duel(Case& c, const TestMesh& made, std::vector<Ray> rays)
        : case_(c), made_(made), rays_(std::move(rays)), expected_(expect_of(made.mesh, rays_)) {}

    void compare(const Trees& trees, const Way& way, Mode mode) {
        trees.ask(way, rays_, mode, answers_);
        if (planted_fault && mode == Mode::any && way.tree == Way::Tree::kdtree)
            answers_.any.back() ^= 1;
        case_.compared(group_of(way, mode), rays_.size());
        const auto wrong = first_wrong(expected_, answers_, mode, rays_.size());
        if (!wrong) return;
        const std::string what = text("%s %s, %s, %s", mode_names[std::size_t(mode)],
                                      sort_of(expected_, answers_, mode, *wrong), family_of(way),
                                      limits_of(rays_[*wrong]));
        case_.found(
            what, case_.wants(what) ? reproducer(made_, rays_, *wrong, way, mode) : std::string());
    }

private:
    /// Answers are counted for each builder, way through the tree, instruction set and edge rule.
    static std::string group_of(const Way& way, Mode mode) {
        std::string name = "rays/";
        name += way.tree == Way::Tree::kdtree ? "-" : builder_name(way.build.builder);
        name += takes_paths(way) ? "/" + std::string(simd_path_name(way.trace.path))
                                 : std::string("/") + tree_names[std::size_t(way.tree)];
        name += "/" + (way.trace.isa.empty() ? std::string("-") : way.trace.isa);
        return name + (mode == Mode::all ? "/half_open" : "/closed");
    }

    Case& case_;
    const TestMesh& made_;
    std::vector<Ray> rays_;
    Expected expected_;
    Answers answers_;
};

constexpr Mode all_modes[] = {Mode::closest, Mode::any, Mode::all};

void attack_wide(Case& c, Duel& duel, Trees& trees, Way way) {
    way.tree = c.random.chance(0.2) ? Way::Tree::direct_wide : Way::Tree::wide;
    way.wide.width = c.random.chance(0.5) ? 8 : 4;
    way.wide.compact = c.random.chance(0.5);
    way.wide.threads = 1;
    trees.use_wide(way);
    static const std::vector<std::string> sets = simd_instruction_sets();
    for (const std::string& isa : sets)
        for (std::uint32_t path = 0; path < 5; ++path)
            for (const Mode mode : all_modes) {
                way.trace.isa = isa;
                way.trace.path = static_cast<SimdPath>(path);
                duel.compare(trees, way, mode);
            }
    way.tree = Way::Tree::wide_single;
    way.trace = {.threads = 1};
    duel.compare(trees, way, Mode::closest);
    duel.compare(trees, way, Mode::any);
}

}  // namespace

static void attack_rays(Case& c) {
    // Most are small: a mesh is asked in some three hundred ways.
    const std::uint32_t most = c.random.chance(0.01) ? 1000 : c.random.chance(0.3) ? 60 : 16;
    const TestMesh made = c.random.chance(0.2)
                              ? make_mesh(c.random, Family::needles, 1 + c.random.below(most))
                              : any_mesh(c.random, most);
    std::vector<Ray> rays = make_rays(c.random, made.mesh, 100 + c.random.below(300));
    const std::vector<Ray> extreme = make_extreme_rays(c.random, made.mesh, 16);
    rays.insert(rays.end(), extreme.begin(), extreme.end());
    const std::vector<Ray> narrower =
        tightened(c.random, rays, trace_brute_force(made.mesh, rays, 1), 200);
    rays.insert(rays.end(), narrower.begin(), narrower.end());
    Duel duel(c, made, std::move(rays));
    Trees trees(made.mesh);
    Way way;
    way.trace.threads = 1;
    for (const BuildOptions& options : every_builder(c.random)) {
        way.build = options;
        trees.use(options);
        way.tree = Way::Tree::binary;
        for (const Mode mode : all_modes) duel.compare(trees, way, mode);
        way.tree = Way::Tree::single;
        duel.compare(trees, way, Mode::closest);
        duel.compare(trees, way, Mode::any);
        way.tree = Way::Tree::cwbvh;
        duel.compare(trees, way, Mode::closest);
        duel.compare(trees, way, Mode::any);
        attack_wide(c, duel, trees, way);
    }
    way.tree = Way::Tree::kdtree;
    way.kd = {.bits = c.random.chance(0.3) ? 30 : 63,
              .max_leaf = static_cast<int>(c.random.below(9)),
              .threads = 1};
    duel.compare(trees, way, Mode::closest);
    duel.compare(trees, way, Mode::any);
}

static const Kind rays_kind("rays", attack_rays, 6);

}  // namespace raydix::attack
