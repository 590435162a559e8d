// Many rays of one class through a wide tree together, each node with all rays that reach it: lists
// of rays are filtered from a node to its children (Tsakok 2009; Barringer, Akenine-Moeller 2014),
// so that vectors are full wherever enough rays go, whatever the order they came in. Included once
// per instruction set by simd_kernels.cpp.
#if defined(RAYDIX_SIMD_STREAM_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_STREAM_H
#undef RAYDIX_SIMD_STREAM_H
#else
#define RAYDIX_SIMD_STREAM_H
#endif

#include "trace/simd/block_hits.h"
#include "trace/simd/children.h"
#include "trace/simd/quads.h"
#include "trace/simd/single.h"
#include "trace/simd/stream_rays.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Lists of fewer rays go on one by one.
constexpr std::uint32_t few_rays = 4;

/// Leaves hold triangles, or parts of a scene (single.h).
template <bool any, bool counting, bool compact, class Parts = NoParts>
class StreamWalk {
public:
    /// `parts` and the places of the rays in the job: unless leaves hold triangles.
    StreamWalk(const WideView& tree, const StreamFrame& frame, StreamMemory& memory,
               const WideStackView& single_stack, SimdCounts& counts, Parts* parts = nullptr,
               const std::int32_t* index = nullptr)
        : parts_(parts),
          index_(index),
          tree_(tree),
          frame_(frame),
          rays_(memory.rays().data()),
          hits_(memory.hits().data()),
          memory_(memory),
          single_stack_(single_stack),
          counts_(counts) {
        for (int axis = 0; axis < 3; ++axis) negative_[axis] = frame.kind.negative(axis);
        count_ = static_cast<std::uint32_t>(memory.rays().size());
    }

    void trace() {
        memory_.reserve(0, count_);
        std::uint32_t* const all = memory_.lists();
        for (std::uint32_t k = 0; k < count_; ++k) all[k] = k;
        auto& stack = memory_.stack();
        stack.clear();
        stack.push_back({0, 0, count_});
        while (!stack.empty()) {
            const StreamEntry next = stack.back();
            stack.pop_back();
            if ((next.word & wide_leaf_bit) != 0) {
                if constexpr (has_parts)
                    visit_parts(next);
                else
                    test_leaf(next);
            } else if (next.count <= few_rays) {
                for (std::uint32_t k = 0; k < next.count; ++k)
                    go_alone(memory_.lists()[next.begin + k], next.word);
            } else {
                visit(next);
            }
        }
    }

private:
    static constexpr bool has_parts = !std::is_same_v<Parts, NoParts>;
    static constexpr std::uint32_t ray_bits = 0xFFFFu;

    /// A ray's number in the lower half, where it enters in the upper: the upper half of a float,
    /// which is never more than the float.
    static HWY_INLINE float entry_of(std::uint32_t item) {
        const std::uint32_t bits = item & ~ray_bits;
        float entry;
        std::memcpy(&entry, &bits, sizeof(entry));
        return entry;
    }

    struct RowsOf {
        const StreamRay* rays;
        const std::uint32_t* list;
        std::size_t quad;
        HWY_INLINE const float* operator()(std::size_t l) const {
            return reinterpret_cast<const float*>(rays + (list[l] & ray_bits)) + 4 * quad;
        }
    };

    /// Ends a list so that whole vectors can be read.
    HWY_INLINE void pad_list(std::uint32_t* list, std::uint32_t count) const {
        hn::StoreU(hn::Set(U16(), list[count - 1]), U16(), list + count);
    }

    /// Planes of a node's children: at origin + step * plane.
    struct CompactPlanes {
        HWY_ALIGN float near[3][8], far[3][8];
        float origin[3], step[3];
    };
    struct PlainPlanes {
        const float *near[3], *far[3];
        float origin[3];
    };
    using Planes = std::conditional_t<compact, CompactPlanes, PlainPlanes>;

    HWY_INLINE CompactPlanes planes_of(const CompactNode& node) const {
        CompactPlanes out;
        for (int axis = 0; axis < 3; ++axis) {
            const std::uint32_t bits = std::uint32_t{node.exponent[axis]} << 23;
            std::memcpy(&out.step[axis], &bits, sizeof(float));
            out.origin[axis] = node.origin[axis];
            const std::uint8_t* const near = negative_[axis] ? node.hi[axis] : node.lo[axis];
            const std::uint8_t* const far = negative_[axis] ? node.lo[axis] : node.hi[axis];
            for (std::size_t l = 0; l < 8; l += lanes8) {
                const auto read = [&](const std::uint8_t* from) {
                    return hn::ConvertTo(f8, hn::PromoteTo(I8(), hn::LoadU(B8(), from)));
                };
                hn::Store(read(near + l), f8, out.near[axis] + l);
                hn::Store(read(far + l), f8, out.far[axis] + l);
            }
        }
        return out;
    }
    HWY_INLINE PlainPlanes planes_of(const WideNode& node) const {
        PlainPlanes out;
        for (int axis = 0; axis < 3; ++axis) {
            out.near[axis] = negative_[axis] ? node.hi[axis] : node.lo[axis];
            out.far[axis] = negative_[axis] ? node.lo[axis] : node.hi[axis];
            out.origin[axis] = tree_.middle[axis];
        }
        return out;
    }

    /// Where a ray enters the children, about.
    HWY_INLINE void find_entries(const Planes& planes, const StreamRay& ray, float* entries) const {
        for (std::size_t l = 0; l < 8; l += lanes8) {
            auto entry = hn::Set(f8, -infinity);
            for (int axis = 0; axis < 3; ++axis) {
                const float inverse = ray.inverse[axis];
                const float start = (planes.origin[axis] - ray.origin[axis]) * inverse;
                float rate = inverse;
                if constexpr (compact) rate *= planes.step[axis];
                const auto near = hn::Load(f8, planes.near[axis] + l);
                entry = hn::Max(entry, hn::MulAdd(near, hn::Set(f8, rate), hn::Set(f8, start)));
            }
            hn::Store(entry, f8, entries + l);
        }
    }

    HWY_INLINE void visit(const StreamEntry& entry) {
        if constexpr (counting) counts_.visits += entry.count;
        const std::uint32_t stride = entry.count + StreamMemory::slack;
        const std::uint32_t out_begin = entry.begin + stride;
        memory_.reserve(out_begin, 8 * stride);
        std::uint32_t* const lists = memory_.lists();
        std::uint32_t* const list = lists + entry.begin;
        pad_list(list, entry.count);
        const auto& node = tree_.template node<compact>(entry.word);
        const Planes planes = planes_of(node);
        std::uint32_t children[8], child_count;  // the farthest first
        if constexpr (any && !has_parts) {       // parts: see single.h
            child_count = order_by_slot(used_slots(node), children);
        } else {
            HWY_ALIGN float entries[8];
            find_entries(planes, rays_[*list & ray_bits], entries);
            child_count = order_by_entry(used_slots(node), entries, children);
        }
        std::uint32_t* ends[8];
        for (std::uint32_t c = 0; c < child_count; ++c) ends[c] = lists + out_begin + c * stride;
        const auto high = hn::Set(U16(), ~ray_bits), low = hn::Set(U16(), ray_bits);
        for (std::uint32_t k = 0; k < entry.count; k += lanes16) {
            V16 place[4], way[4];
            load_quads(RowsOf{rays_, list + k, 0}, place);
            load_quads(RowsOf{rays_, list + k, 1}, way);
            const auto items = hn::LoadU(U16(), list + k);
            const V16 reach = place[3], tmin = way[3];
            V16 rate[3], near[3], far[3];
            for (int axis = 0; axis < 3; ++axis) {
                const V16 from = hn::Sub(hn::Set(f16, planes.origin[axis]), place[axis]);
                const V16 pad = hn::Set(f16, frame_.near_pad[axis]);
                rate[axis] = way[axis];
                if constexpr (compact)
                    rate[axis] = hn::Mul(hn::Set(f16, planes.step[axis]), way[axis]);
                near[axis] = hn::Mul(hn::Add(from, pad), way[axis]);
                far[axis] = hn::Mul(hn::Sub(from, pad), way[axis]);
            }
            auto active = hn::Le(hn::BitCast(f16, hn::And(items, high)), reach);
            if (entry.count - k < lanes16)
                active = hn::And(active, hn::FirstN(f16, entry.count - k));
            const auto numbers = hn::And(items, low);
            for (std::uint32_t c = 0; c < child_count; ++c) {
                const std::uint32_t s = children[c];
                V16 in = tmin;
                V16 leave = hn::MulAdd(hn::Set(f16, planes.far[0][s]), rate[0], far[0]);
                in = hn::Max(in, hn::MulAdd(hn::Set(f16, planes.near[0][s]), rate[0], near[0]));
                for (int axis = 1; axis < 3; ++axis) {
                    in = hn::Max(
                        in, hn::MulAdd(hn::Set(f16, planes.near[axis][s]), rate[axis], near[axis]));
                    leave = hn::Min(leave, hn::MulAdd(hn::Set(f16, planes.far[axis][s]), rate[axis],
                                                      far[axis]));
                }
                const auto met = hn::And(hn::Le(in, hn::Min(leave, reach)), active);
                const auto item = hn::Or(hn::And(hn::BitCast(U16(), in), high), numbers);
                const std::uint32_t going = bits_of(f16, met);
                hn::StoreU(compress(U16(), item, hn::RebindMask(U16(), met), going), U16(),
                           ends[c]);
                ends[c] += std::popcount(going);
            }
        }
        push_children(node, children, ends, child_count, out_begin, stride);
    }

    /// Lists that hold a ray go onto the stack, moved together: gaps would add up in deep trees.
    /// Without jumps but for long lists: which are empty cannot be foreseen.
    template <class Node>
    HWY_INLINE void push_children(const Node& node, const std::uint32_t* children,
                                  std::uint32_t* const* ends, std::uint32_t child_count,
                                  std::uint32_t out_begin, std::uint32_t stride) {
        std::uint32_t* const lists = memory_.lists();
        std::vector<StreamEntry>& stack = memory_.stack();
        const std::size_t before = stack.size();
        stack.resize(before + child_count);
        StreamEntry* to = stack.data() + before;
        std::uint32_t free = out_begin;
        for (std::uint32_t c = 0; c < child_count; ++c) {
            const std::uint32_t* const list = lists + out_begin + c * stride;
            const auto count = static_cast<std::uint32_t>(ends[c] - list);
            const bool goes = count != 0;
            const std::uint32_t word = node.child[children[c]];
            hn::StoreU(hn::LoadU(U16(), list), U16(), lists + free);
            for (std::uint32_t k = lanes16; k < count; k += lanes16)
                hn::StoreU(hn::LoadU(U16(), list + k), U16(), lists + free + k);
            if constexpr (!has_parts)
                ask_for<compact>(tree_, word);
            else if constexpr (Parts::large)
                parts_->ask_for(word);
            *to = {word, free, count};
            to += goes;
            free += goes ? count + StreamMemory::slack : 0;
        }
        stack.resize(static_cast<std::size_t>(to - stack.data()));
    }

    void go_alone(std::uint32_t item, std::uint32_t word) {
        const std::uint32_t k = item & ray_bits;
        StreamRay& ray = rays_[k];
        if (!(entry_of(item) <= ray.t)) return;
        SingleFrame frame;
        fill_frame(tree_, frame_, ray, frame);
        if constexpr (has_parts) {
            const auto place = static_cast<std::uint32_t>(index_[k]);
            ray.t = SingleRay < any ? Wanted::any : Wanted::closest, counting, compact, false,
            Parts > (tree_, frame, single_stack_, counts_, parts_, place).trace(word, {ray.t}).t;
            return;
        }
        SingleRay<any ? Wanted::any : Wanted::closest, counting, compact> single(
            tree_, frame, single_stack_, counts_);
        const WideBest best = single.trace(word, {ray.t, ray.prim, hits_[k].u, hits_[k].v});
        if (any) {
            if (best.found()) ray.settle();
        } else {
            ray.t = best.t, ray.prim = best.prim, hits_[k] = {best.u, best.v};
        }
    }

    /// The rays of a list that may still hit something there go to the parts of a leaf.
    void visit_parts(const StreamEntry& entry) {
        const std::uint32_t place = (entry.word & ~wide_leaf_bit) >> 3,
                            count = (entry.word & 7) + 1;
        std::vector<std::uint32_t>& going = memory_.going();
        going.clear();
        const std::uint32_t* const list = memory_.lists() + entry.begin;
        for (std::uint32_t k = 0; k < entry.count; ++k)
            if (entry_of(list[k]) <= rays_[list[k] & ray_bits].t)
                going.push_back(static_cast<std::uint32_t>(index_[list[k] & ray_bits]));
        if (going.empty()) return;
        parts_->visit(place, count, going.data(), static_cast<std::uint32_t>(going.size()));
        for (std::uint32_t k = 0; k < entry.count; ++k) {
            const std::uint32_t ray = list[k] & ray_bits;
            rays_[ray].t = parts_->reach(static_cast<std::uint32_t>(index_[ray]));
        }
    }

    /// t is at most that of the best hit; at equal t the lower primitive wins.
    HWY_INLINE void take(std::uint32_t k, float t, std::uint32_t prim, float u, float v) {
        StreamRay& ray = rays_[k];
        if constexpr (any)
            ray.settle();
        else if (t < ray.t || prim < ray.prim)
            ray.t = t, ray.prim = prim, hits_[k] = {u, v};
    }

    /// Rays of a chunk of a list, for triangles; axes in the order kx, ky, kz.
    struct Chunk {
        const std::uint32_t* list;
        V16 away[3];  // - origin: adding it is the same as subtracting the origin
        V16 shear_x, shear_y, way, tmin, reach;  // way: along kz
    };

    HWY_INLINE Chunk load_chunk(const std::uint32_t* list) const {
        Chunk chunk;
        chunk.list = list;
        V16 place[4], way[4];
        load_quads(RowsOf{rays_, chunk.list, 0}, place);
        load_quads(RowsOf{rays_, chunk.list, 2}, way);
        chunk.away[0] = hn::Neg(place[frame_.kind.kx]);
        chunk.away[1] = hn::Neg(place[frame_.kind.ky]);
        chunk.away[2] = hn::Neg(place[frame_.kind.kz]);
        chunk.shear_x = way[0], chunk.shear_y = way[1], chunk.way = way[2], chunk.tmin = way[3];
        chunk.reach = place[3];
        return chunk;
    }

    void test_leaf(const StreamEntry& entry) {
        const std::uint32_t place = (entry.word & ~wide_leaf_bit) >> 3,
                            count = (entry.word & 7) + 1;
        const TriangleBlock& block = tree_.template block<compact>(place);
        std::uint32_t* const list = memory_.lists() + entry.begin;
        if constexpr (counting) counts_.tests += std::uint64_t{count} * entry.count;
        pad_list(list, entry.count);
        for (std::uint32_t k = 0; k < entry.count; k += lanes16) {
            const Chunk chunk = load_chunk(list + k);
            const auto items = hn::LoadU(U16(), list + k);
            auto active =
                hn::Le(hn::BitCast(f16, hn::And(items, hn::Set(U16(), ~ray_bits))), chunk.reach);
            if (entry.count - k < lanes16)
                active = hn::And(active, hn::FirstN(f16, entry.count - k));
            const std::uint32_t wanted = bits_of(f16, active);
            if (wanted == 0) continue;
            for (std::uint32_t lane = place % block_lanes; lane < place % block_lanes + count;
                 ++lane)
                test_triangle(block, lane, chunk, wanted);
        }
    }

    HWY_INLINE Sheared<F16> shear(const float* x, const float* y, const float* z,
                                  const Chunk& chunk) const {
        const V16 depth = hn::Add(hn::Set(f16, *z), chunk.away[2]);
        return {hn::Sub(hn::Add(hn::Set(f16, *x), chunk.away[0]), hn::Mul(chunk.shear_x, depth)),
                hn::Sub(hn::Add(hn::Set(f16, *y), chunk.away[1]), hn::Mul(chunk.shear_y, depth)),
                depth};
    }

    /// intersect_triangle for the rays of the chunk in `wanted`: the same bits.
    HWY_INLINE void test_triangle(const TriangleBlock& block, std::uint32_t lane,
                                  const Chunk& chunk, std::uint32_t wanted) {
        constexpr std::size_t next = 3 * block_lanes;
        const float* const x = block.corner[frame_.kind.kx] + lane;
        const float* const y = block.corner[frame_.kind.ky] + lane;
        const float* const z = block.corner[frame_.kind.kz] + lane;
        const Sheared<F16> a = shear(x, y, z, chunk),
                           b = shear(x + next, y + next, z + next, chunk),
                           c = shear(x + 2 * next, y + 2 * next, z + 2 * next, chunk);
        const V16 u = edge(c, b), v = edge(a, c), w = edge(b, a);
        std::uint32_t candidates = wanted & ~bits_of(f16, astride(f16, u, v, w));
        if (candidates == 0) return;
        const std::uint32_t clear = bits_of(f16, without_zero(f16, u, v, w));
        if constexpr (any) {
            const Limits<F16> limits{chunk.tmin, chunk.reach, chunk.way,
                                     std::fabs(frame_.near_pad[frame_.kind.kz]),
                                     negative_[frame_.kind.kz]};
            const AnyHit hit = any_hit(f16, limits, a, b, c, u, v, w, candidates, clear);
            for (std::uint32_t left = hit.certain; left != 0; left &= left - 1)
                rays_[chunk.list[std::countr_zero(left)] & ray_bits].settle();
            candidates = hit.open;
            if (candidates == 0) return;
        }
        finish(block, lane, chunk.list, candidates, clear);
    }

    /// From so many rays on vectors of rays cost less than one ray after the other.
    static constexpr int least_together = 4;

    /// `clear`: rays none of whose edge functions is 0 or NaN.
    HWY_NOINLINE void finish(const TriangleBlock& block, std::uint32_t lane,
                             const std::uint32_t* list, std::uint32_t candidates,
                             std::uint32_t clear) {
        clear &= candidates;
        if (std::popcount(clear) >= least_together) {
            finish_together(block, lane, list, clear);
            candidates &= ~clear;
        }
        for (; candidates != 0; candidates &= candidates - 1) {
            const auto l = static_cast<std::uint32_t>(std::countr_zero(candidates));
            finish_one(block, lane, list[l] & ray_bits, (clear >> l & 1) != 0);
        }
    }
    HWY_INLINE void finish_one(const TriangleBlock& block, std::uint32_t lane, std::uint32_t k,
                               bool is_clear) {
        const StreamRay& ray = rays_[k];
        TriangleHit hit;
        if (is_clear && hit_lane<false>(block, lane, ray.origin, ray.direction, frame_.kind,
                                        ray.tmin, hit)
                ? hit.t >= ray.tmin && hit.t <= ray.t
                : test_exactly(frame_.triangle_ray(ray), block, lane, ray.t, hit))
            take(k, hit.t, block.prim[lane], hit.u, hit.v);
    }

    using D = hn::Repartition<double, F16>;
    using VD = hn::Vec<D>;

    struct TogetherHits {
        HWY_ALIGN float t[lanes16], u[lanes16], v[lanes16];
        std::uint32_t sure = 0;  // the others must be asked alone
    };
    /// Rays `from` to from + (lanes of D) - 1; places and ways as doubles.
    HWY_INLINE void weigh_together(const TriangleBlock& block, std::uint32_t lane,
                                   const VD (&place)[3], const VD (&way)[3], std::size_t from,
                                   TogetherHits& hits) const {
        const D d;
        const weights::HalfOf<D> h;
        VD corner[3][3], direction[3];
        for (std::uint32_t k = 0; k < 3; ++k) {
            const std::uint32_t axis = frame_.kind.axis(k);
            direction[k] = way[axis];
            for (std::uint32_t c = 0; c < 3; ++c)
                corner[c][k] =
                    hn::Sub(weights::spread(d, block.corner[3 * c + axis][lane]), place[axis]);
        }
        const auto at = weights::weigh(d, corner, direction);
        // Where there is a far corner rays are asked alone, before tmin too.
        const auto near =
            weights::near_corner(d, weights::farthest(corner), hn::Mul(at.t, direction[2]));
        hits.sure |= (weights::inside(d, at) & bits_of(d, near)) << from;
        hn::Store(weights::rounded(d, at.t), h, hits.t + from);
        hn::Store(weights::rounded(d, at.u), h, hits.u + from);
        hn::Store(weights::rounded(d, at.v), h, hits.v + from);
    }
    /// finish_one for all rays of the list in `which`, none of whose edge functions is 0 or NaN.
    HWY_INLINE void finish_together(const TriangleBlock& block, std::uint32_t lane,
                                    const std::uint32_t* list, std::uint32_t which) {
        constexpr std::size_t lanes_d = hn::MaxLanes(D());
        HWY_ALIGN std::uint32_t items[lanes16];
        const auto mask = mask_of(U16(), which);
        hn::Store(compress(U16(), hn::LoadU(U16(), list), mask, which), U16(), items);
        V16 place[4], way[4];
        load_quads(RowsOf{rays_, items, 0}, place);
        load_quads(RowsOf{rays_, items, 3}, way);
        const auto count = static_cast<std::uint32_t>(std::popcount(which));
        TogetherHits hits;
        const auto weigh = [&](std::size_t from, const auto& half) {
            const auto doubles = [&](V16 x) { return hn::PromoteTo(D(), half(x)); };
            weigh_together(block, lane, {doubles(place[0]), doubles(place[1]), doubles(place[2])},
                           {doubles(way[0]), doubles(way[1]), doubles(way[2])}, from, hits);
        };
        weigh(0, [](V16 x) { return hn::LowerHalf(x); });
        if (count > lanes_d)
            weigh(lanes_d, [](V16 x) { return hn::UpperHalf(weights::HalfOf<D>(), x); });
        for (std::uint32_t j = 0; j < count; ++j) {
            const std::uint32_t k = items[j] & ray_bits;
            if ((hits.sure >> j & 1) == 0)
                finish_one(block, lane, k, true);
            else if (hits.t[j] >= rays_[k].tmin && hits.t[j] <= rays_[k].t)
                take(k, hits.t[j], block.prim[lane], hits.u[j], hits.v[j]);
        }
    }

    Parts* const parts_;
    const std::int32_t* const index_;
    const WideView& tree_;
    const StreamFrame& frame_;
    StreamRay* const rays_;
    StreamHit* const hits_;
    StreamMemory& memory_;
    const WideStackView single_stack_;
    SimdCounts& counts_;
    std::uint32_t count_;
    bool negative_[3];
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
