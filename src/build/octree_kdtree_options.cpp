#include "build/octree_kdtree_options.h"

#include <raydix/error.h>

#include <string>

#include "tree/kdtree.h"

namespace raydix {
namespace {

// Boxes of triangles reach into each other, and a leaf has none of its own: a test saved there is
// worth a node. Distances to points are cheaper than nodes.
constexpr int default_leaf_points = 8, default_leaf_triangles = 4;

constexpr std::uint64_t most_octree_points = (std::uint64_t{1} << 28) - 1;

int finest_level(int bits) { return bits / 3; }

void check_bits(const std::string& tree, int bits) {
    if (bits != 30 && bits != 63)
        throw InputError(tree + " option bits is " + std::to_string(bits) +
                         "; it must be 30 or 63");
}

}  // namespace

KdTreeOptions resolved(KdTreeOptions options, PrimitiveKind kind, std::uint64_t n) {
    check_bits("k-d tree", options.bits);
    if (options.max_leaf < 0 || options.max_leaf > 255)
        throw InputError("k-d tree option max_leaf is " + std::to_string(options.max_leaf) +
                         "; it must be 1 to 255, or 0");
    if (n >= std::uint64_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
    if (options.max_leaf == 0)
        options.max_leaf =
            kind == PrimitiveKind::points ? default_leaf_points : default_leaf_triangles;
    return options;
}

OctreeOptions resolved(OctreeOptions options, std::uint64_t n) {
    check_bits("octree", options.bits);
    if (options.max_level < -1 || options.max_level > finest_level(options.bits))
        throw InputError("octree option max_level is " + std::to_string(options.max_level) +
                         "; with " + std::to_string(options.bits) + " bits it must be 0 to " +
                         std::to_string(finest_level(options.bits)) + ", or -1 for that");
    if (options.max_leaf < 1)
        throw InputError("octree option max_leaf is " + std::to_string(options.max_leaf) +
                         "; it must be at least 1");
    if (n > most_octree_points)
        throw InputError(std::to_string(n) + " points; an octree takes at most " +
                         std::to_string(most_octree_points));
    if (options.max_level < 0) options.max_level = finest_level(options.bits);
    return options;
}

void check_kd_inner(std::uint64_t inner, std::uint64_t primitives) {
    if (inner > max_kd_inner)
        throw InputError(std::to_string(inner) + " inner nodes over " + std::to_string(primitives) +
                         " primitives; a k-d tree takes " + std::to_string(max_kd_inner) +
                         ": raise max_leaf");
}

}  // namespace raydix
