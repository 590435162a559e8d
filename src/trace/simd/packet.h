// Up to 64 rays of one class through a wide tree together: children are first tested against
// intervals that hold all rays (Boulos, Wald, Shirley 2006), then against the rays in vectors;
// where few rays are left, each of them against all children. Included once per instruction set by
// simd_kernels.cpp.
#if defined(RAYDIX_SIMD_PACKET_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_PACKET_H
#undef RAYDIX_SIMD_PACKET_H
#else
#define RAYDIX_SIMD_PACKET_H
#endif

#include <hwy/highway.h>

#include "trace/simd/children.h"
#include "trace/simd/lanes.h"
#include "trace/simd/packet_triangles.h"
#include "trace/simd/single.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Up to so many rays of a packet go to a node one by one.
constexpr int few_rays_of_packet = 12;

/// What a packet does at the leaves of a tree over parts (single.h).
template <Wanted query, class Parts>
class PacketParts {
    static constexpr bool any = query == Wanted::any;
    static_assert(query != Wanted::all);

public:
    PacketParts(Packet& packet, const std::int32_t* index, Parts& parts)
        : p_(packet), index_(index), parts_(parts) {}

    [[nodiscard]] std::uint64_t found() const { return found_; }

    HWY_INLINE void ask_for(std::uint32_t word) const {
        if constexpr (Parts::large) parts_.ask_for(word);
    }

    void visit(std::uint32_t first, std::uint32_t parts, std::uint64_t active) {
        std::uint32_t rays[packet_size], count = 0;
        for (std::uint64_t left = active; left != 0; left &= left - 1)
            rays[count++] = static_cast<std::uint32_t>(index_[std::countr_zero(left)]);
        parts_.visit(first, parts, rays, count);
        const std::uint32_t* ray = rays;
        for (std::uint64_t left = active; left != 0; left &= left - 1, ++ray) {
            const auto k = static_cast<std::size_t>(std::countr_zero(left));
            p_.t[k] = parts_.reach(*ray);
            if (any && p_.t[k] < 0) found_ |= std::uint64_t{1} << k;
        }
    }

private:
    Packet& p_;
    const std::int32_t* const index_;
    Parts& parts_;
    std::uint64_t found_ = 0;
};

/// Which class does that: Parts may have one of its own.
template <Wanted query, class Parts>
struct LeavesOfPacket {
    using Type = PacketParts<query, Parts>;
};
template <Wanted query, class Parts>
requires requires { typename Parts::OfPacket; }
struct LeavesOfPacket<query, Parts> {
    using Type = typename Parts::OfPacket;
};
template <Wanted query>
struct LeavesOfPacket<query, NoParts> {
    using Type = PacketTriangles<query>;
};

template <Wanted query, bool counting, bool compact, class Parts = NoParts>
class PacketWalk {
    static constexpr bool any = wants_any(query), closest = wants_closest(query);
    static constexpr bool has_parts = !std::is_same_v<Parts, NoParts>;
    /// For any hit too, where Parts say so.
    static constexpr bool nearest_first = requires { requires Parts::packets_nearest_first; };
    using Leaves = typename LeavesOfPacket<query, Parts>::Type;

public:
    /// Through triangles. `rays`: what the packet was filled with, rays[index[k]]; `all`, `check`:
    /// as PacketTriangles has them.
    PacketWalk(const WideView& tree, Packet& packet, const Ray* rays, const std::int32_t* index,
               const PacketStackView& stack, SimdCounts& counts, BudgetVector<Hit>* all = nullptr,
               const HitCheck* check = nullptr) requires(!has_parts)
        : PacketWalk(tree, packet, Leaves(packet, rays, index, all, check), stack, counts) {}
    /// Through parts. Ray k of the packet is index[k] to them.
    PacketWalk(const WideView& tree, Packet& packet, const std::int32_t* index, Parts& parts,
               const PacketStackView& stack, SimdCounts& counts) requires(has_parts)
        : PacketWalk(tree, packet, Leaves(packet, index, parts), stack, counts) {}

private:
    PacketWalk(const WideView& tree, Packet& packet, const Leaves& leaves,
               const PacketStackView& stack, SimdCounts& counts)
        : tree_(tree), p_(packet), leaves_(leaves), stack_(stack), counts_(counts) {
        for (int axis = 0; axis < 3; ++axis) negative_[axis] = packet.kind.negative(axis);
    }

public:
    void trace() {
        find_reach();
        stack_.words[0] = 0;
        stack_.entries[0] = p_.least_tmin;
        stack_.active[0] = all_rays();
        std::size_t top = 1;
        while (top > 0) {
            --top;
            if (!(stack_.entries[top] <= reach_)) continue;
            std::uint64_t active = stack_.active[top];
            if constexpr (any) active &= ~leaves_.found();
            if (active == 0) continue;
            const std::uint32_t word = stack_.words[top];
            if ((word & wide_leaf_bit) != 0) {
                test_leaf(word, active);
                if (any && leaves_.found() == all_rays()) return;
            } else {
                top = visit(tree_.template node<compact>(word), active, top);
            }
        }
    }

    [[nodiscard]] std::uint64_t found() const { return leaves_.found(); }

private:
    using V = hn::Vec<F16>;

    HWY_INLINE void ask_for_child(std::uint32_t word) const {
        if constexpr (has_parts)
            leaves_.ask_for(word);
        else
            ask_for<compact>(tree_, word);
    }

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
        V rate[3], near[3], far[3], tmin, reach;
    };
    HWY_INLINE RayNode ray_node(const Frame& frame, std::size_t i) const {
        RayNode out;
        out.tmin = hn::Load(f16, p_.tmin + i);
        out.reach = hn::Load(f16, p_.t + i);
        for (int axis = 0; axis < 3; ++axis) {
            const V inverse = hn::Load(f16, p_.inverse[axis] + i);
            if constexpr (compact) {
                const V from =
                    hn::Sub(hn::Set(f16, frame.origin[axis]), hn::Load(f16, p_.origin[axis] + i));
                const V pad = hn::Set(f16, negative_[axis] ? p_.pad[axis] : -p_.pad[axis]);
                out.rate[axis] = hn::Mul(hn::Set(f16, frame.step[axis]), inverse);
                out.near[axis] = hn::Mul(hn::Add(from, pad), inverse);
                out.far[axis] = hn::Mul(hn::Sub(from, pad), inverse);
            } else {
                out.rate[axis] = inverse;
                out.near[axis] = hn::Load(f16, p_.near[axis] + i);
                out.far[axis] = hn::Load(f16, p_.far[axis] + i);
            }
        }
        return out;
    }

    HWY_INLINE std::uint32_t test_rays(const RayNode& ray, const Planes& planes,
                                       std::size_t child) const {
        V entry = ray.tmin;
        V leave = ray.reach;
        for (int axis = 0; axis < 3; ++axis) {
            entry = hn::Max(entry, hn::MulAdd(hn::Set(f16, planes.near[axis][child]),
                                              ray.rate[axis], ray.near[axis]));
            leave = hn::Min(leave, hn::MulAdd(hn::Set(f16, planes.far[axis][child]), ray.rate[axis],
                                              ray.far[axis]));
        }
        return bits_of(f16, hn::Le(entry, leave));
    }

    template <class Node>
    HWY_INLINE std::size_t visit(const Node& node, std::uint64_t active, std::size_t top) {
        const int ray_count = std::popcount(active);
        if constexpr (counting) counts_.visits += static_cast<std::uint64_t>(ray_count);
        const Frame frame = frame_of(node);
        return ray_count <= few_rays_of_packet ? visit_by_ray(node, frame, active, top)
                                               : visit_by_vector(node, frame, active, top);
    }

    template <class Node>
    HWY_INLINE std::size_t visit_by_vector(const Node& node, const Frame& frame,
                                           std::uint64_t active, std::size_t top) {
        Planes planes;
        HWY_ALIGN float entries[8];
        const std::uint32_t met = test_intervals(node, frame, planes, entries);
        if (met == 0) return top;
        std::uint32_t order[8];
        const std::uint32_t child_count = order_of(met, entries, order);
        std::uint64_t hit[8] = {};
        for (std::size_t i = 0; i < packet_size; i += lanes16) {
            if ((active >> i & vector_bits) == 0) continue;
            const RayNode ray = ray_node(frame, i);
            for (std::uint32_t c = 0; c < child_count; ++c)
                hit[c] |= std::uint64_t{test_rays(ray, planes, order[c])} << i;
        }
        for (std::uint32_t c = 0; c < child_count; ++c) {
            const std::uint32_t s = order[c];
            ask_for_child(node.child[s]);
            stack_.words[top] = node.child[s];
            stack_.entries[top] = entries[s];
            stack_.active[top] = hit[c] & active;
            top += stack_.active[top] != 0;  // whether any ray goes on cannot be foreseen
        }
        return top;
    }

    /// What one ray needs of a node: a plane is near + rate * plane away, or far + rate * plane.
    struct OneRay {
        float rate[3], near[3], far[3];
    };
    HWY_INLINE OneRay one_ray(const Frame& frame, std::size_t k) const {
        OneRay out;
        for (int axis = 0; axis < 3; ++axis) {
            const float inverse = p_.inverse[axis][k];
            if constexpr (compact) {
                const float from = frame.origin[axis] - p_.origin[axis][k],
                            pad = negative_[axis] ? p_.pad[axis] : -p_.pad[axis];
                out.rate[axis] = frame.step[axis] * inverse;
                out.near[axis] = (from + pad) * inverse;
                out.far[axis] = (from - pad) * inverse;
            } else {
                out.rate[axis] = inverse;
                out.near[axis] = p_.near[axis][k];
                out.far[axis] = p_.far[axis][k];
            }
        }
        return out;
    }

    /// A few rays, each against all children.
    template <class Node>
    HWY_INLINE std::size_t visit_by_ray(const Node& node, const Frame& frame, std::uint64_t active,
                                        std::size_t top) {
        using V8 = hn::Vec<F8>;
        constexpr std::size_t parts = 8 / lanes8;
        V8 near[3][parts], far[3][parts], least[parts];
        for (std::size_t part = 0; part < parts; ++part) {
            const std::size_t l = part * lanes8;
            least[part] = hn::Set(f8, infinity);
            for (int axis = 0; axis < 3; ++axis) {
                near[axis][part] = read((negative_[axis] ? node.hi[axis] : node.lo[axis]) + l);
                far[axis][part] = read((negative_[axis] ? node.lo[axis] : node.hi[axis]) + l);
            }
        }
        RaySets rays;
        std::uint32_t met = 0;
        for (; active != 0; active &= active - 1) {
            const auto k = static_cast<std::size_t>(std::countr_zero(active));
            const OneRay ray = one_ray(frame, k);
            std::uint32_t here = 0;
            for (std::size_t part = 0; part < parts; ++part) {
                V8 entry = hn::Set(f8, p_.tmin[k]), leave = hn::Set(f8, p_.t[k]);
                for (int axis = 0; axis < 3; ++axis) {
                    const V8 rate = hn::Set(f8, ray.rate[axis]);
                    entry = hn::Max(
                        entry, hn::MulAdd(near[axis][part], rate, hn::Set(f8, ray.near[axis])));
                    leave = hn::Min(leave,
                                    hn::MulAdd(far[axis][part], rate, hn::Set(f8, ray.far[axis])));
                }
                const auto meets = hn::Le(entry, leave);
                here |= bits_of(f8, meets) << (part * lanes8);
                least[part] =
                    hn::Min(least[part], hn::IfThenElse(meets, entry, hn::Set(f8, infinity)));
            }
            met |= here;
            rays.add(here, std::uint64_t{1} << k);
        }
        met &= used_slots(node);
        if (met == 0) return top;
        HWY_ALIGN float entries[8];
        for (std::size_t part = 0; part < parts; ++part)
            hn::Store(least[part], f8, entries + part * lanes8);
        HWY_ALIGN std::uint64_t sets[8];
        rays.store(sets);
        std::uint32_t order[8];
        const std::uint32_t child_count = order_of(met, entries, order);
        for (std::uint32_t c = 0; c < child_count; ++c) {
            const std::uint32_t s = order[c];
            ask_for_child(node.child[s]);
            stack_.words[top] = node.child[s];
            stack_.entries[top] = entries[s];
            stack_.active[top++] = sets[s];
        }
        return top;
    }

    static HWY_INLINE std::uint32_t order_of(std::uint32_t met, const float* entries,
                                             std::uint32_t* order) {
        return closest || nearest_first ? order_by_entry(met, entries, order)
                                        : order_by_slot(met, order);
    }

    void test_leaf(std::uint32_t word, std::uint64_t active) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        if constexpr (has_parts) {
            leaves_.visit(place, count, active);
            if (closest) find_reach();
        } else {
            const TriangleBlock& block = tree_.template block<compact>(place);
            if constexpr (counting)
                counts_.tests += count * static_cast<std::uint64_t>(std::popcount(active));
            if (leaves_.test(block, place % block_lanes, count, active) && closest) find_reach();
        }
    }

    const WideView& tree_;
    Packet& p_;
    Leaves leaves_;
    const PacketStackView stack_;
    SimdCounts& counts_;
    bool negative_[3];
    float reach_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
