// Up to 64 rays of one class through a wide tree together: children are first tested against
// intervals that hold all rays (Boulos, Wald, Shirley 2006), then against the rays in vectors.
// Included once per instruction set by simd_kernels.cpp.
#if defined(RAYDIX_SIMD_PACKET_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_PACKET_H
#undef RAYDIX_SIMD_PACKET_H
#else
#define RAYDIX_SIMD_PACKET_H
#endif

#include <hwy/highway.h>

#include "trace/simd/children.h"
#include "trace/simd/lanes.h"
#include "trace/simd/ray_classes.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

constexpr std::size_t packet_size = 64;

/// Rays of one class (ray_classes.h), as arrays. Places from `count` on repeat the last ray and
/// are never active.
struct Packet {
    HWY_ALIGN float origin[3][packet_size];
    HWY_ALIGN float inverse[3][packet_size];  // limited
    HWY_ALIGN float true_inverse[3][packet_size];
    HWY_ALIGN float shear_x[packet_size], shear_y[packet_size], shear_z[packet_size];
    HWY_ALIGN float tmin[packet_size];
    HWY_ALIGN float t[packet_size], u[packet_size], v[packet_size];
    HWY_ALIGN std::uint32_t prim[packet_size];
    std::uint32_t count;
    RayClass kind;
    float pad[3];  // of boxes, the largest of all rays; positive
    float origin_lo[3], origin_hi[3];
    float least_inverse[3], largest_inverse[3];  // magnitudes
    float least_tmin;
};

template <bool any, bool counting, bool compact>
class PacketWalk {
public:
    PacketWalk(const WideView& tree, Packet& packet, const PacketStackView& stack,
               SimdCounts& counts)
        : tree_(tree), p_(packet), stack_(stack), counts_(counts) {
        for (int axis = 0; axis < 3; ++axis) negative_[axis] = packet.kind.negative(axis);
    }

    void trace() {
        done_ = ~all_rays();
        find_reach();
        stack_.words[0] = 0;
        stack_.entries[0] = p_.least_tmin;
        stack_.active[0] = all_rays();
        std::size_t top = 1;
        while (top > 0) {
            --top;
            if (!(stack_.entries[top] <= reach_)) continue;
            const std::uint64_t active = any ? stack_.active[top] & ~done_ : stack_.active[top];
            if (active == 0) continue;
            const std::uint32_t word = stack_.words[top];
            if ((word & wide_leaf_bit) != 0) {
                test_leaf(word, active);
                if (any && done_ == ~std::uint64_t{0}) return;
            } else {
                top = visit(tree_.template node<compact>(word), active, top);
            }
        }
    }

    [[nodiscard]] std::uint64_t found() const { return done_ & all_rays(); }

private:
    using V = hn::Vec<F16>;

    [[nodiscard]] std::uint64_t all_rays() const {
        return p_.count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << p_.count) - 1;
    }

    static constexpr std::uint64_t vector_bits = (std::uint64_t{1} << lanes16) - 1;

    /// The farthest that any ray still looks.
    void find_reach() {
        V farthest = hn::Load(f16, p_.t);
        for (std::size_t i = lanes16; i < packet_size; i += lanes16)
            farthest = hn::Max(farthest, hn::Load(f16, p_.t + i));
        reach_ = hn::GetLane(hn::MaxOfLanes(f16, farthest));
    }

    /// Planes of a node's children; of a compact node in steps.
    struct Planes {
        HWY_ALIGN float near[3][8], far[3][8];
    };
    /// The planes are at origin + step * plane; `steps` are 1 for plain nodes.
    struct Frame {
        float origin[3], step[3];
    };
    static HWY_INLINE Frame frame_of(const CompactNode& node) {
        Frame frame;
        for (int axis = 0; axis < 3; ++axis) {
            const std::uint32_t bits = std::uint32_t{node.exponent[axis]} << 23;
            std::memcpy(&frame.step[axis], &bits, sizeof(float));
            frame.origin[axis] = node.origin[axis];
        }
        return frame;
    }
    HWY_INLINE Frame frame_of(const WideNode&) const {
        return {{tree_.middle[0], tree_.middle[1], tree_.middle[2]}, {1.0f, 1.0f, 1.0f}};
    }
    static HWY_INLINE auto read(const float* from) { return hn::Load(f8, from); }
    static HWY_INLINE auto read(const std::uint8_t* from) {
        return hn::ConvertTo(f8, hn::PromoteTo(I8(), hn::LoadU(B8(), from)));
    }

    /// Entry of the nearest and exit of the farthest ray for each child; bits of children that some
    /// ray may meet.
    template <class Node>
    HWY_INLINE std::uint32_t test_intervals(const Node& node, const Frame& frame, Planes& planes,
                                            float* entries) const {
        std::uint32_t met = 0;
        for (std::size_t l = 0; l < 8; l += lanes8) {
            auto entry = hn::Set(f8, p_.least_tmin);
            auto leave = hn::Set(f8, infinity);
            for (int axis = 0; axis < 3; ++axis) {
                const bool negative = negative_[axis];
                const auto near = read((negative ? node.hi[axis] : node.lo[axis]) + l);
                const auto far = read((negative ? node.lo[axis] : node.hi[axis]) + l);
                hn::Store(near, f8, planes.near[axis] + l);
                hn::Store(far, f8, planes.far[axis] + l);
                const float rate = (negative ? -1.0f : 1.0f) * frame.step[axis];
                const float start = negative ? p_.origin_lo[axis] - frame.origin[axis]
                                             : frame.origin[axis] - p_.origin_hi[axis];
                const float end = negative ? p_.origin_hi[axis] - frame.origin[axis]
                                           : frame.origin[axis] - p_.origin_lo[axis];
                const auto from =
                    hn::MulAdd(near, hn::Set(f8, rate), hn::Set(f8, start - p_.pad[axis]));
                const auto to = hn::MulAdd(far, hn::Set(f8, rate), hn::Set(f8, end + p_.pad[axis]));
                const auto least = hn::Set(f8, p_.least_inverse[axis]),
                           largest = hn::Set(f8, p_.largest_inverse[axis]);
                entry = hn::Max(entry, hn::Min(hn::Mul(from, least), hn::Mul(from, largest)));
                leave = hn::Min(leave, hn::Max(hn::Mul(to, least), hn::Mul(to, largest)));
            }
            const auto exit = hn::Min(leave, hn::Set(f8, reach_));
            hn::Store(entry, f8, entries + l);
            met |= bits_of(f8, hn::Le(entry, exit)) << l;
        }
        // The box of a missing child is not enough: where a ray's pads overflow it is NaN, which
        // the minima and maxima of some processors drop.
        return met & used_slots(node);
    }
    /// What a vector of rays needs of a node.
    struct RayNode {
        V rate[3], near[3], far[3];
    };
    HWY_INLINE RayNode ray_node(const Frame& frame, std::size_t i) const {
        RayNode out;
        for (int axis = 0; axis < 3; ++axis) {
            const V inverse = hn::Load(f16, p_.inverse[axis] + i);
            const V from =
                hn::Sub(hn::Set(f16, frame.origin[axis]), hn::Load(f16, p_.origin[axis] + i));
            const V pad = hn::Set(f16, negative_[axis] ? p_.pad[axis] : -p_.pad[axis]);
            out.rate[axis] = compact ? hn::Mul(hn::Set(f16, frame.step[axis]), inverse) : inverse;
            out.near[axis] = hn::Mul(hn::Add(from, pad), inverse);
            out.far[axis] = hn::Mul(hn::Sub(from, pad), inverse);
        }
        return out;
    }

    HWY_INLINE std::uint32_t test_rays(const RayNode& ray, const Planes& planes, std::size_t child,
                                       std::size_t i) const {
        V entry = hn::Load(f16, p_.tmin + i);
        V leave = hn::Set(f16, infinity);
        for (int axis = 0; axis < 3; ++axis) {
            entry = hn::Max(entry, hn::MulAdd(hn::Set(f16, planes.near[axis][child]),
                                              ray.rate[axis], ray.near[axis]));
            leave = hn::Min(leave, hn::MulAdd(hn::Set(f16, planes.far[axis][child]), ray.rate[axis],
                                              ray.far[axis]));
        }
        const V exit = hn::Min(leave, hn::Load(f16, p_.t + i));
        return bits_of(f16, hn::Le(entry, exit));
    }

    template <class Node>
    HWY_INLINE std::size_t visit(const Node& node, std::uint64_t active, std::size_t top) {
        if constexpr (counting) counts_.visits += static_cast<std::uint64_t>(std::popcount(active));
        const Frame frame = frame_of(node);
        Planes planes;
        HWY_ALIGN float entries[8];
        const std::uint32_t met = test_intervals(node, frame, planes, entries);
        if (met == 0) return top;
        RayNode rays[packet_size / lanes16];
        std::uint32_t vectors[packet_size / lanes16], vector_count = 0;
        for (std::uint32_t v = 0; v < packet_size / lanes16; ++v) {
            if ((active >> (v * lanes16) & vector_bits) == 0) continue;
            rays[vector_count] = ray_node(frame, v * lanes16);
            vectors[vector_count++] = v;
        }
        std::uint32_t order[8];
        const std::uint32_t child_count =
            any ? order_by_area(met, order) : order_by_entry(met, entries, order);
        for (std::uint32_t c = 0; c < child_count; ++c) {
            const std::uint32_t s = order[c];
            std::uint64_t hit = 0;
            for (std::uint32_t k = 0; k < vector_count; ++k) {
                const std::size_t shift = vectors[k] * lanes16;
                hit |= std::uint64_t{test_rays(rays[k], planes, s, shift)} << shift;
            }
            hit &= active;
            if (hit == 0) continue;
            stack_.words[top] = node.child[s];
            ask_for<compact>(tree_, node.child[s]);
            stack_.entries[top] = entries[s];
            stack_.active[top++] = hit;
        }
        return top;
    }

    void test_leaf(std::uint32_t word, std::uint64_t active) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        const TriangleBlock& block = tree_.template block<compact>(place);
        if constexpr (counting)
            counts_.tests += count * static_cast<std::uint64_t>(std::popcount(active));
        bool changed = false;
        for (std::size_t vector = 0; vector < packet_size / lanes16; ++vector) {
            const auto wanted =
                static_cast<std::uint32_t>(active >> (vector * lanes16) & vector_bits);
            if (wanted == 0) continue;
            for (std::uint32_t k = 0; k < count; ++k)
                changed |= test_triangle(block, place % block_lanes + k, vector * lanes16, wanted);
        }
        if (changed && !any) find_reach();
    }

    struct Sheared {
        V x, y, z;  // z before shear_z
    };
    HWY_INLINE Sheared shear(const TriangleBlock& block, int vertex, std::uint32_t lane,
                             std::size_t i) const {
        const auto at = [&](std::uint32_t axis) {
            return hn::Sub(hn::Set(f16, block.corner[3 * vertex + static_cast<int>(axis)][lane]),
                           hn::Load(f16, p_.origin[axis] + i));
        };
        const V z = at(p_.kind.kz);
        return {hn::Sub(at(p_.kind.kx), hn::Mul(hn::Load(f16, p_.shear_x + i), z)),
                hn::Sub(at(p_.kind.ky), hn::Mul(hn::Load(f16, p_.shear_y + i), z)), z};
    }
    static HWY_INLINE V edge(const Sheared& a, const Sheared& b) {
        return hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x));
    }

    /// intersect_triangle for the rays i + (bits of `wanted`): the same bits. Whether any ray came
    /// nearer.
    HWY_INLINE bool test_triangle(const TriangleBlock& block, std::uint32_t lane, std::size_t i,
                                  std::uint32_t wanted) {
        const Sheared a = shear(block, 0, lane, i), b = shear(block, 1, lane, i),
                      c = shear(block, 2, lane, i);
        const V u = edge(c, b), v = edge(a, c), w = edge(b, a);
        const V zero = hn::Zero(f16);
        const V least = hn::Min(hn::Min(u, v), w), largest = hn::Max(hn::Max(u, v), w);
        const auto outside = hn::And(hn::Lt(least, zero), hn::Gt(largest, zero));
        std::uint32_t candidates = wanted & ~bits_of(f16, outside);
        if (candidates == 0) return false;
        const auto on_edge = hn::Or(hn::Or(hn::Eq(u, zero), hn::Eq(v, zero)), hn::Eq(w, zero));
        const std::uint32_t near_edge = candidates & bits_of(f16, on_edge);
        bool changed = false;
        if (near_edge != 0) changed = test_exactly(block, lane, i, near_edge);
        candidates &= ~near_edge;
        if (candidates == 0) return changed;
        return accept(block, lane, i, candidates, a, b, c, u, v, w) || changed;
    }

    [[nodiscard]] RayFrame frame_of(std::size_t k) const {
        RayFrame frame;
        frame.origin = {p_.origin[0][k], p_.origin[1][k], p_.origin[2][k]};
        frame.inverse = {p_.true_inverse[0][k], p_.true_inverse[1][k], p_.true_inverse[2][k]};
        frame.kx = static_cast<int>(p_.kind.kx), frame.ky = static_cast<int>(p_.kind.ky),
        frame.kz = static_cast<int>(p_.kind.kz);
        frame.shear_x = p_.shear_x[k], frame.shear_y = p_.shear_y[k], frame.shear_z = p_.shear_z[k];
        frame.tmin = p_.tmin[k], frame.tmax = p_.t[k];
        frame.t_scale = 1.0f;
        return frame;
    }

    HWY_NOINLINE bool test_exactly(const TriangleBlock& block, std::uint32_t lane, std::size_t i,
                                   std::uint32_t rays) {
        bool changed = false;
        for (; rays != 0; rays &= rays - 1) {
            const std::size_t k = i + static_cast<std::size_t>(std::countr_zero(rays));
            TriangleHit hit;
            if (!intersect_triangle<EdgeRule::closed>(frame_of(k), triangle_of(block, lane),
                                                      p_.t[k], hit))
                continue;
            done_ |= std::uint64_t{1} << k;
            if (hit.t < p_.t[k] || block.prim[lane] < p_.prim[k]) {
                p_.t[k] = hit.t, p_.u[k] = hit.u, p_.v[k] = hit.v, p_.prim[k] = block.prim[lane];
                changed = true;
            }
        }
        return changed;
    }

    HWY_INLINE bool accept(const TriangleBlock& block, std::uint32_t lane, std::size_t i,
                           std::uint32_t candidates, const Sheared& a, const Sheared& b,
                           const Sheared& c, V u, V v, V w) {
        const V determinant = hn::Add(hn::Add(u, v), w);
        const V shear_z = hn::Load(f16, p_.shear_z + i);
        const V depth =
            hn::Add(hn::Add(hn::Mul(u, hn::Mul(shear_z, a.z)), hn::Mul(v, hn::Mul(shear_z, b.z))),
                    hn::Mul(w, hn::Mul(shear_z, c.z)));
        V t = hn::Div(depth, determinant);
        V entry = hn::Set(f16, -infinity), exit = hn::Set(f16, infinity);
        for (int axis = 0; axis < 3; ++axis) {
            const float p = block.corner[axis][lane], q = block.corner[3 + axis][lane],
                        r = block.corner[6 + axis][lane];
            const float lo = min_of(min_of(p, q), r), hi = max_of(max_of(p, q), r);
            const V origin = hn::Load(f16, p_.origin[axis] + i);
            const V inverse = hn::Load(f16, p_.true_inverse[axis] + i);
            const V near =
                hn::Mul(hn::Sub(hn::Set(f16, negative_[axis] ? hi : lo), origin), inverse);
            const V far =
                hn::Mul(hn::Sub(hn::Set(f16, negative_[axis] ? lo : hi), origin), inverse);
            entry = hn::IfThenElse(hn::Gt(near, entry), near, entry);
            exit = hn::IfThenElse(hn::Lt(far, exit), far, exit);
        }
        V held = hn::IfThenElse(hn::Gt(t, entry), t, entry);
        held = hn::IfThenElse(hn::Lt(held, exit), held, exit);
        t = hn::IfThenElse(hn::Le(entry, exit), held, t);
        const V reach = hn::Load(f16, p_.t + i);
        const auto sound = hn::And(hn::Ne(determinant, hn::Zero(f16)),
                                   hn::Lt(hn::Abs(determinant), hn::Set(f16, infinity)));
        const auto in_reach = hn::And(hn::Ge(t, hn::Load(f16, p_.tmin + i)), hn::Le(t, reach));
        candidates &= bits_of(f16, hn::And(sound, in_reach));
        if (candidates == 0) return false;
        done_ |= std::uint64_t{candidates} << i;
        if constexpr (any) return true;
        // At equal t the lower primitive wins.
        const U16 u16;
        const auto prim = hn::Set(u16, block.prim[lane]);
        const auto old_prim = hn::Load(u16, p_.prim + i);
        const auto better =
            hn::Or(hn::Lt(t, reach), hn::RebindMask(f16, hn::Eq(hn::Min(prim, old_prim), prim)));
        const auto take = hn::And(better, mask_of(f16, candidates));
        hn::Store(hn::IfThenElse(take, t, reach), f16, p_.t + i);
        hn::Store(hn::IfThenElse(take, hn::Div(v, determinant), hn::Load(f16, p_.u + i)), f16,
                  p_.u + i);
        hn::Store(hn::IfThenElse(take, hn::Div(w, determinant), hn::Load(f16, p_.v + i)), f16,
                  p_.v + i);
        hn::Store(hn::IfThenElse(hn::RebindMask(u16, take), prim, old_prim), u16, p_.prim + i);
        return true;
    }

    const WideView& tree_;
    Packet& p_;
    const PacketStackView stack_;
    SimdCounts& counts_;
    bool negative_[3];
    std::uint64_t done_ = 0;  // closest: rays that have hit; any: rays that need nothing more
    float reach_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
