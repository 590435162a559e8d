// The public checks: one tree against its invariants, two trees against each other.
#include <raydix/check.h>

#include <fmt/format.h>

#include <cstring>
#include <vector>

#include "exec/parallel.h"
#include "tree/validate.h"

namespace raydix {
namespace {

CheckReport report(const Bvh& bvh, Fault fault) {
    CheckReport result;
    result.ok = !fault;
    if (fault) result.broken = *std::move(fault);
    result.nodes = std::uint64_t{bvh.inner_count()} + bvh.leaf_count();
    result.primitives = bvh.order().size();
    return result;
}

/// "KEY: a / b" if they differ.
template <class T>
Fault differ(const char* what, const T& a, const T& b) {
    if (a == b) return {};
    return fmt::format("{}: {} / {}", what, a, b);
}

Fault compare_counts(const Bvh& a, const Bvh& b) {
    const auto kind = [](const Bvh& bvh) { return static_cast<std::uint32_t>(bvh.kind()); };
    if (Fault f = differ("primitive kind", kind(a), kind(b))) return f;
    if (Fault f = differ("code bits", a.options().bits, b.options().bits)) return f;
    if (Fault f = differ("max_leaf", a.options().max_leaf, b.options().max_leaf)) return f;
    if (Fault f = differ("primitives given", a.input_count(), b.input_count())) return f;
    if (Fault f = differ("references", a.order().size(), b.order().size())) return f;
    if (Fault f = differ("inner nodes", a.inner_count(), b.inner_count())) return f;
    return differ("depth", a.max_depth(), b.max_depth());
}

template <class T>
Fault compare_bytes(const char* what, std::span<const T> a, std::span<const T> b) {
    if (a.size() != b.size()) return differ(what, a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i)
        if (std::memcmp(&a[i], &b[i], sizeof(T)) != 0)
            return fmt::format("{} differ first at position {}", what, i);
    return {};
}

/// Both trees in preorder side by side: slots may be numbered differently.
Fault compare_nodes(const Bvh& a, const Bvh& b) {
    struct Pair {
        std::uint32_t a, b;
    };
    if (a.nodes().empty()) return {};
    std::vector<Pair> waiting{{0, 0}};
    while (!waiting.empty()) {
        const Pair at = waiting.back();
        waiting.pop_back();
        const BvhNode& node_a = a.nodes()[at.a];
        const BvhNode& node_b = b.nodes()[at.b];
        if (node_a.count != node_b.count)
            return fmt::format("nodes {} / {}: count {} / {}", at.a, at.b, node_a.count,
                               node_b.count);
        if (std::memcmp(&node_a.lo, &node_b.lo, sizeof(Vec3)) != 0 ||
            std::memcmp(&node_a.hi, &node_b.hi, sizeof(Vec3)) != 0)
            return fmt::format("nodes {} / {}: boxes differ", at.a, at.b);
        if (node_a.is_leaf())
            continue;  // leaves of equal counts in equal order start at equal positions
        waiting.push_back({node_a.first + 1, node_b.first + 1});
        waiting.push_back({node_a.first, node_b.first});
    }
    return {};
}

Fault compare(const Bvh& a, const Bvh& b) {
    if (Fault f = compare_counts(a, b)) return f;
    if (Fault f = compare_nodes(a, b)) return f;
    if (Fault f = compare_bytes("orders", a.order(), b.order())) return f;
    if (Fault f = compare_bytes("leaf triangles", a.triangles(), b.triangles())) return f;
    if (Fault f = compare_bytes("leaf boxes", a.boxes(), b.boxes())) return f;
    return compare_bytes("leaf points", a.points(), b.points());
}

}  // namespace

CheckReport check(const Bvh& bvh) {
    Fault fault;
    with_threads(0, [&] { fault = validate(bvh); });
    return report(bvh, std::move(fault));
}

CheckReport check(const Bvh& bvh, const MeshView& mesh) {
    Fault fault;
    with_threads(0, [&] { fault = validate(bvh, &mesh); });
    return report(bvh, std::move(fault));
}

CheckReport check_same(const Bvh& a, const Bvh& b) { return report(a, compare(a, b)); }

}  // namespace raydix
