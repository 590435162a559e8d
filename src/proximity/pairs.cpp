// Pairs of primitives of trees in float.
#include <raydix/error.h>
#include <raydix/pairs.h>

#include <optional>
#include <string>

#include "proximity/pair_search.h"
#include "proximity/unsplit_tree.h"

namespace raydix {
namespace {

/// A tree in the shape that walks want, with what had to be made for that.
class PairSide {
public:
    PairSide(const Bvh& given, const Bvh&) {
        if (has_parts(given)) whole_ = make_unsplit_tree(given);
        const Bvh& bvh = whole_ ? *whole_ : given;
        boxes_.reset(bvh.order().size());
        for_each_index(boxes_.size(), [&](std::size_t k) {
            const Aabb box = box_at(bvh, k);
            boxes_[k] = {box.lo, bvh.order()[k], box.hi, 0};
        });
        keys_.reset(bvh.triangles().size());
        for_each_index(keys_.size(),
                       [&](std::size_t k) { keys_[k] = corner_keys(bvh.triangles()[k]); });
        const bool triangles = bvh.kind() == PrimitiveKind::triangles;
        tree = {bvh.nodes().data(), boxes_.data(), triangles ? bvh.triangles().data() : nullptr,
                keys_.data(), bvh.max_depth()};
    }

    PairTree tree;

    /// At most, what a side holds while it is made.
    static std::uint64_t bytes_for(const Bvh& bvh) {
        const std::uint64_t own =
            bvh.order().size() * sizeof(PairBox) + bvh.triangles().size() * sizeof(CornerKeys);
        return own + (has_parts(bvh) ? unsplit_tree_bytes(bvh) : 0);
    }

private:
    static Aabb box_at(const Bvh& bvh, std::size_t k) {
        if (bvh.kind() == PrimitiveKind::boxes) return bvh.boxes()[k];
        if (bvh.kind() == PrimitiveKind::points) return {bvh.points()[k], bvh.points()[k]};
        const LeafTriangle& t = bvh.triangles()[k];
        return box_of(t.v0, t.v1, t.v2);
    }

    std::optional<Bvh> whole_;
    Buffer<PairBox> boxes_;
    Buffer<CornerKeys> keys_;
};

void check_narrow(const Bvh& bvh, const PairOptions& options) {
    if (options.narrow && !bvh.empty() && bvh.kind() != PrimitiveKind::triangles)
        throw InputError(std::string("pairs: narrow needs triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
}

void check_narrow(const Bvh& a, const Bvh& b, const PairOptions& options) {
    check_narrow(a, options);
    check_narrow(b, options);
}

}  // namespace

std::vector<PrimitivePair> overlapping_pairs(const Bvh& bvh, const PairOptions& options) {
    check_narrow(bvh, options);
    return all_pairs<PairSide, Bvh>(bvh, nullptr, options);
}

std::vector<PrimitivePair> overlapping_pairs(const Bvh& a, const Bvh& b,
                                             const PairOptions& options) {
    check_narrow(a, b, options);
    return all_pairs<PairSide>(a, &b, options);
}

std::uint64_t count_overlapping_pairs(const Bvh& bvh, const PairOptions& options) {
    check_narrow(bvh, options);
    return run_pairs<PairSide, Bvh>(bvh, nullptr, options, nullptr);
}

std::uint64_t count_overlapping_pairs(const Bvh& a, const Bvh& b, const PairOptions& options) {
    check_narrow(a, b, options);
    return run_pairs<PairSide>(a, &b, options, nullptr);
}

}  // namespace raydix
