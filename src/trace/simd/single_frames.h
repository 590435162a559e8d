// Frames of rays that go one by one, a vector of rays at a time: the numbers of fill_frame, for a
// small part of its time. Included once per instruction set.
#if defined(RAYDIX_SIMD_SINGLE_FRAMES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SINGLE_FRAMES_H
#undef RAYDIX_SIMD_SINGLE_FRAMES_H
#else
#define RAYDIX_SIMD_SINGLE_FRAMES_H
#endif

#include <cstddef>
#include <cstdint>

#include "trace/simd/ray_vectors.h"
#include "trace/simd/single_frame.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Frames of the rays of a tree, in their order.
class SingleFrames {
public:
    explicit SingleFrames(const WideView& tree) : tree_(tree) {}

    /// Bit k: rays[index[k]], k < lanes16, passes the tree's bounds by; not set for some that do.
    [[nodiscard]] HWY_INLINE std::uint32_t passing_by(const Ray* rays,
                                                      const std::int32_t* index) const {
        const RayVectors ray = read_rays(rays, index);
        const auto codes = classify(ray);
        const auto odd = hn::RebindMask(f16, hn::Eq(codes, hn::Set(I16(), int{odd_ray_class})));
        const Slabs slabs = slabs_of(ray, codes);
        return bits_of(f16, hn::AndNot(odd, hn::And(slabs.plain, pass_by(slabs))));
    }

    /// rays[index[k]] for k < lanes16.
    HWY_INLINE void fill(const Ray* rays, const std::int32_t* index) {
        const RayVectors ray = read_rays(rays, index);
        const auto codes = classify(ray);
        hn::Store(codes, I16(), codes_);
        const Slabs slabs = slabs_of(ray, codes);
        careful_ = ~bits_of(f16, slabs.plain);
        // The two axes behind kz; they change places where the ray goes backward.
        const V16 zero = hn::Zero(f16), way = by_axis(codes, ray.way[0], ray.way[1], ray.way[2]),
                  first = by_axis(codes, ray.way[1], ray.way[2], ray.way[0]),
                  second = by_axis(codes, ray.way[2], ray.way[0], ray.way[1]);
        const auto backward = hn::Lt(way, zero);
        const V16 last[4] = {hn::Div(hn::IfThenElse(backward, second, first), way),
                             hn::Div(hn::IfThenElse(backward, first, second), way), slabs.tmin,
                             slabs.tmax};
        store(slabs.origin, &SingleFrame::origin);
        store(ray.way, &SingleFrame::direction);
        store(slabs.inverse, &SingleFrame::inverse);
        store(slabs.near_pad, &SingleFrame::near_pad);
        store(slabs.near, &SingleFrame::near);
        store(slabs.far, &SingleFrame::far);
        store_quads(last, [this](std::size_t l) { return frames_[l].shear; });
    }

    /// Of ray k; false if it is left to fill_frame.
    HWY_INLINE bool take(std::size_t k, SingleFrame& out) const {
        const auto code = static_cast<std::uint32_t>(codes_[k]);
        if (code == odd_ray_class) return false;
        copy(frames_[k], out);
        out.kind = ray_classes[code];
        out.t_scale = 1.0f;
        out.careful = (careful_ >> k & 1) != 0;
        return true;
    }

private:
    /// What the test of boxes has of a ray.
    struct Slabs {
        V16 origin[3], inverse[3], near_pad[3], near[3], far[3], tmin, tmax;
        hn::Mask<F16> plain;  // not SingleFrame::careful
    };

    static HWY_INLINE V16 by_axis(hn::Vec<I16> codes, V16 x, V16 y, V16 z) {
        const auto along = hn::ShiftRight<3>(codes);  // kz
        const auto is_axis = [&](int a) {
            return hn::RebindMask(f16, hn::Eq(along, hn::Set(I16(), a)));
        };
        return hn::IfThenElse(is_axis(2), z, hn::IfThenElse(is_axis(1), y, x));
    }

    [[nodiscard]] HWY_INLINE Slabs slabs_of(const RayVectors& ray, hn::Vec<I16> codes) const {
        const V16 zero = hn::Zero(f16), most = hn::Set(f16, std::numeric_limits<float>::max());
        Slabs out;
        V16 reach[3];
        for (int a = 0; a < 3; ++a) {
            out.origin[a] = hn::Add(ray.place[a], zero);  // -0 becomes +0
            const V16 limit = hn::Set(f16, wide_longest_inverse);
            out.inverse[a] =
                hn::Max(hn::Min(hn::Div(hn::Set(f16, 1.0f), ray.way[a]), limit), hn::Neg(limit));
            reach[a] = hn::Max(hn::Abs(hn::Sub(hn::Set(f16, tree_.lo[a]), out.origin[a])),
                               hn::Abs(hn::Sub(hn::Set(f16, tree_.hi[a]), out.origin[a])));
        }
        const V16 depth = by_axis(codes, reach[0], reach[1], reach[2]);
        out.plain = hn::Le(zero, zero);
        for (int a = 0; a < 3; ++a) {
            const V16 pad =
                hn::Add(hn::Mul(hn::Set(f16, wide_pad_factor * slab_pad), hn::Add(reach[a], depth)),
                        hn::Set(f16, least_slab_pad));
            out.near_pad[a] = hn::CopySignToAbs(pad, hn::Neg(ray.way[a]));
            const V16 from = hn::Sub(hn::Set(f16, tree_.middle[a]), out.origin[a]);
            out.near[a] = hn::Mul(hn::Add(from, out.near_pad[a]), out.inverse[a]);
            out.far[a] = hn::Mul(hn::Sub(from, out.near_pad[a]), out.inverse[a]);
            out.plain = hn::And(out.plain,
                                hn::Le(hn::Add(hn::Abs(out.near[a]), hn::Abs(out.far[a])), most));
        }
        out.tmin = hn::IfThenElseZero(hn::Gt(ray.place[3], zero), ray.place[3]);
        out.tmax = hn::Min(ray.way[3], most);
        return out;
    }

    /// Rays that pass the root's bounds by, widened as boxes of nodes are.
    HWY_INLINE hn::Mask<F16> pass_by(const Slabs& slabs) const {
        V16 in = slabs.tmin, out = slabs.tmax;
        for (int a = 0; a < 3; ++a) {
            const float half = max_of(tree_.hi[a] - tree_.middle[a], tree_.middle[a] - tree_.lo[a]);
            const V16 reach = hn::Mul(hn::Abs(slabs.inverse[a]),
                                      hn::Set(f16, half * (1.0f + 0x1p-20f)));  // and its rounding
            in = hn::Max(in, hn::Sub(slabs.near[a], reach));
            out = hn::Min(out, hn::Add(slabs.far[a], reach));
        }
        return hn::Gt(in, out);
    }

    /// The three first of `from`, and 0.
    HWY_INLINE void store(const V16* from, float (SingleFrame::*to)[4]) {
        const V16 four[4] = {from[0], from[1], from[2], hn::Zero(f16)};
        store_quads(four, [&](std::size_t l) { return frames_[l].*to; });
    }

    /// What store wrote, in the same fours: other loads would have to wait for it.
    static HWY_INLINE void copy(const SingleFrame& from, SingleFrame& to) {
        constexpr std::size_t floats = offsetof(SingleFrame, kind) / sizeof(float);
        static_assert(floats % 4 == 0 && offsetof(SingleFrame, tmin) ==
                                             offsetof(SingleFrame, shear) + 2 * sizeof(float));
        const float* const in = from.origin;
        float* const out = to.origin;
        for (std::size_t f = 0; f < floats; f += 4) hn::Store(hn::Load(f4, in + f), f4, out + f);
    }

    const WideView& tree_;
    SingleFrame frames_[lanes16];
    HWY_ALIGN std::int32_t codes_[lanes16];
    std::uint32_t careful_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
