// Overlapping pairs within a tree and between two, by boxes and by triangles, against all pairs one
// by one in whole-number geometry.
#include <raydix/pairs.h>

#include "attack/attack.h"
#include "attack/exact.h"
#include "attack/parts.h"
#include "attack/precision.h"

namespace raydix::attack {
namespace {

using Pairs = std::vector<PrimitivePair>;

struct Box {
    Vec3d lo, hi;
};
Box box_of(const Corners& c) {
    const auto least = [](double a, double b, double d) { return std::min({a, b, d}); };
    const auto most = [](double a, double b, double d) { return std::max({a, b, d}); };
    return {
        {least(c[0].x, c[1].x, c[2].x), least(c[0].y, c[1].y, c[2].y),
         least(c[0].z, c[1].z, c[2].z)},
        {most(c[0].x, c[1].x, c[2].x), most(c[0].y, c[1].y, c[2].y), most(c[0].z, c[1].z, c[2].z)}};
}
bool meet(const Box& a, const Box& b) {
    return a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y &&
           a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}
bool share_corner(const Corners& a, const Corners& b) {
    for (const Vec3d& p : a)
        for (const Vec3d& q : b)
            if (p.x == q.x && p.y == q.y && p.z == q.z) return true;
    return false;
}

struct Part {
    std::uint32_t id;
    Corners corners;
    Box box;
};
template <class AnyMesh>
std::vector<Part> parts_of(const AnyMesh& mesh) {
    std::vector<Part> parts;
    for (const std::uint32_t t : valid_triangles(mesh)) {
        const Corners corners = corners_of(mesh, t);
        parts.push_back({t, corners, box_of(corners)});
    }
    return parts;
}
bool are_pair(const Part& a, const Part& b, bool narrow) {
    return meet(a.box, b.box) && (!narrow || exact_touch(a.corners, b.corners));
}

Pairs within(const std::vector<Part>& parts, bool narrow) {
    Pairs pairs;
    for (std::size_t i = 0; i < parts.size(); ++i)
        for (std::size_t j = i + 1; j < parts.size(); ++j)
            if (!share_corner(parts[i].corners, parts[j].corners) &&
                are_pair(parts[i], parts[j], narrow))
                pairs.push_back({parts[i].id, parts[j].id});
    return pairs;
}
Pairs between(const std::vector<Part>& a, const std::vector<Part>& b, bool narrow) {
    Pairs pairs;
    for (const Part& p : a)
        for (const Part& q : b)
            if (are_pair(p, q, narrow)) pairs.push_back({p.id, q.id});
    return pairs;
}

template <class In>
void attack_in(Case& c) {
    const Scenery<In> first(c.random, any_mesh(c.random, 24)),
        second(c.random, any_mesh(c.random, 24));
    const PairOptions options{.narrow = c.random.chance(0.5), .threads = 1};
    const Pairs self = within(parts_of(first.mesh), options.narrow),
                both = between(parts_of(first.mesh), parts_of(second.mesh), options.narrow);
    const auto other = build_bvh(second.mesh, any_build_options(c.random));
    for (const BuildOptions& build : every_builder(c.random)) {
        const auto tree = build_bvh(first.mesh, build);
        const auto expect = [&](bool right, const char* what) {
            c.expect(right, text("pairs/%s", In::name),
                     text("%s, %s, %s", what, options.narrow ? "narrow" : "boxes", In::name), [&] {
                         return "    " + text_of(build) +
                                text(", families %s and %s\n", family_name(first.family),
                                     family_name(second.family)) +
                                text_of(first.mesh) + text_of(second.mesh);
                     });
        };
        expect(overlapping_pairs(tree, options) == self, "pairs within a tree");
        expect(count_overlapping_pairs(tree, options) == self.size(), "count within a tree");
        expect(overlapping_pairs(tree, other, options) == both, "pairs between trees");
        expect(count_overlapping_pairs(tree, other, options) == both.size(), "count between trees");
    }
}

}  // namespace

static void attack_pairs(Case& c) {
    if (c.random.chance(0.5))
        attack_in<InFloat>(c);
    else
        attack_in<InDouble>(c);
}

static const Kind pairs_kind("pairs", attack_pairs, 1);

}  // namespace raydix::attack
