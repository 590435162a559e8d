// A moving point against boxes that are larger by some room on all sides, in double, and the walk
// through the nodes that it enters. The room is a ball's radius, or what rounding may have lost.
#pragma once

#include <raydix/bvh.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "base/double3.h"
#include "trace/walk.h"

namespace raydix {

/// origin + t * direction for t in [tmin, tmax].
struct Path {
    Double3 origin, direction;
    double tmin, tmax;

    [[nodiscard]] Double3 at(double t) const { return origin + direction * t; }
};

inline constexpr double never = std::numeric_limits<double>::infinity();

/// When the path enters a box that is `radius` larger on all sides: each step is monotone, so a box
/// around another is never entered later. Never, if it misses by more than rounding.
class GrownBoxes {
public:
    GrownBoxes(const Path& path, double radius)
        : path_(path),
          radius_(radius),
          inverse_(1.0 / path.direction.x, 1.0 / path.direction.y, 1.0 / path.direction.z) {}

    /// Corner: Vec3, Vec3d or Double3.
    template <class Corner>
    [[nodiscard]] double enter(const Corner& lo, const Corner& hi) const {
        double enter = path_.tmin, leave = path_.tmax;
        const auto axis = [&](double from, double to, double origin, double direction,
                              double inverse) {
            const double below = from - origin - radius_, above = to - origin + radius_;
            if (direction == 0.0) {
                if (below > 0.0 || above < 0.0) leave = -never;
                return;
            }
            enter = std::max(enter, (direction > 0.0 ? below : above) * inverse);
            leave = std::min(leave, (direction > 0.0 ? above : below) * inverse);
        };
        axis(lo.x, hi.x, path_.origin.x, path_.direction.x, inverse_.x);
        axis(lo.y, hi.y, path_.origin.y, path_.direction.y, inverse_.y);
        axis(lo.z, hi.z, path_.origin.z, path_.direction.z, inverse_.z);
        const double slack = 1e-12 * (std::fabs(enter) + std::fabs(leave));
        return enter <= leave + slack ? enter : never;
    }

private:
    Path path_;
    double radius_;
    Double3 inverse_;
};

/// `enter(node)` is when a node is entered, or infinity; `leaf(node) -> bool` handles a leaf and
/// says whether to stop; a node is skipped if it is entered later than `reach()`. The tree must not
/// be empty; its root is entered unasked.
template <class Scalar, class Enter, class Leaf, class Reach>
void walk_entered(const BvhNode* nodes, BasicWalkStack<Scalar>& stack, const Enter& enter,
                  const Leaf& leaf, const Reach& reach) {
    constexpr Scalar not_at_all = infinity;
    BasicPendingNode<Scalar>* const bottom = stack.begin();
    BasicPendingNode<Scalar>* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = nodes[slot];
        if (node.is_leaf()) {
            if (leaf(node)) return;
        } else {
            const Scalar a = enter(nodes[node.first]), b = enter(nodes[node.first + 1]);
            const bool b_first = b < a;
            const Scalar nearer = b_first ? b : a, farther = b_first ? a : b;
            if (nearer <= reach() && nearer < not_at_all) {
                if (farther <= reach() && farther < not_at_all) {
                    RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                    *top++ = {node.first + (b_first ? 0u : 1u), farther};
                }
                slot = node.first + (b_first ? 1u : 0u);
                continue;
            }
        }
        do {
            if (top == bottom) return;
            slot = (--top)->slot;
        } while (top->entry > reach());
    }
}

}  // namespace raydix
