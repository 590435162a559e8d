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
    /// `passing`: whether to find out which rays pass the tree's bounds by.
    SingleFrames(const WideView& tree, bool passing) : tree_(tree), passing_(passing) {}

    /// rays[index[k]] for k < lanes16.
    HWY_INLINE void fill(const Ray* rays, const std::int32_t* index) {
        const RayVectors ray = read_rays(rays, index);
        const auto codes = classify(ray);
        hn::Store(codes, I16(), codes_);
        const V16 zero = hn::Zero(f16), none = zero;
        V16 origin[4], inverse[4], reach[3], near_pad[4], near[4], far[4];
        for (int a = 0; a < 3; ++a) {
            origin[a] = hn::Add(ray.place[a], zero);  // -0 becomes +0
            const V16 limit = hn::Set(f16, wide_longest_inverse);
            inverse[a] =
                hn::Max(hn::Min(hn::Div(hn::Set(f16, 1.0f), ray.way[a]), limit), hn::Neg(limit));
            reach[a] = hn::Max(hn::Abs(hn::Sub(hn::Set(f16, tree_.lo[a]), origin[a])),
                               hn::Abs(hn::Sub(hn::Set(f16, tree_.hi[a]), origin[a])));
        }
        const auto along = hn::ShiftRight<3>(codes);  // kz
        const auto is_axis = [&](int a) {
            return hn::RebindMask(f16, hn::Eq(along, hn::Set(I16(), a)));
        };
        const auto by_axis = [&](const V16& x, const V16& y, const V16& z) {
            return hn::IfThenElse(is_axis(2), z, hn::IfThenElse(is_axis(1), y, x));
        };
        const V16 depth = by_axis(reach[0], reach[1], reach[2]);
        const V16 most = hn::Set(f16, std::numeric_limits<float>::max());
        auto plain = hn::Le(zero, zero);
        for (int a = 0; a < 3; ++a) {
            const V16 pad =
                hn::Add(hn::Mul(hn::Set(f16, wide_pad_factor * slab_pad), hn::Add(reach[a], depth)),
                        hn::Set(f16, least_slab_pad));
            near_pad[a] = hn::CopySignToAbs(pad, hn::Neg(ray.way[a]));
            const V16 from = hn::Sub(hn::Set(f16, tree_.middle[a]), origin[a]);
            near[a] = hn::Mul(hn::Add(from, near_pad[a]), inverse[a]);
            far[a] = hn::Mul(hn::Sub(from, near_pad[a]), inverse[a]);
            plain = hn::And(plain, hn::Le(hn::Add(hn::Abs(near[a]), hn::Abs(far[a])), most));
        }
        careful_ = ~bits_of(f16, plain);
        const V16 tmin = hn::IfThenElseZero(hn::Gt(ray.place[3], zero), ray.place[3]),
                  tmax = hn::Min(ray.way[3], most);
        if (passing_) pass_by_ = bits_of(f16, pass_by(inverse, near, far, tmin, tmax)) & ~careful_;
        // The two axes behind kz; they change places where the ray goes backward.
        const V16 way = by_axis(ray.way[0], ray.way[1], ray.way[2]),
                  first = by_axis(ray.way[1], ray.way[2], ray.way[0]),
                  second = by_axis(ray.way[2], ray.way[0], ray.way[1]);
        const auto backward = hn::Lt(way, zero);
        const V16 last[4] = {hn::Div(hn::IfThenElse(backward, second, first), way),
                             hn::Div(hn::IfThenElse(backward, first, second), way), tmin, tmax};
        origin[3] = inverse[3] = near_pad[3] = near[3] = far[3] = none;
        const V16 direction[4] = {ray.way[0], ray.way[1], ray.way[2], none};
        store(origin, &SingleFrame::origin);
        store(direction, &SingleFrame::direction);
        store(inverse, &SingleFrame::inverse);
        store(near_pad, &SingleFrame::near_pad);
        store(near, &SingleFrame::near);
        store(far, &SingleFrame::far);
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

    /// Whether ray k passes the bounds by; false for some that do.
    [[nodiscard]] HWY_INLINE bool passes_by(std::size_t k) const {
        return (pass_by_ >> k & 1) != 0 && static_cast<std::uint32_t>(codes_[k]) != odd_ray_class;
    }

private:
    /// Rays that pass the root's bounds by, widened as boxes of nodes are.
    HWY_INLINE hn::Mask<F16> pass_by(const V16 (&inverse)[4], const V16 (&near)[4],
                                     const V16 (&far)[4], V16 tmin, V16 tmax) const {
        V16 in = tmin, out = tmax;
        for (int a = 0; a < 3; ++a) {
            const float half = max_of(tree_.hi[a] - tree_.middle[a], tree_.middle[a] - tree_.lo[a]);
            const V16 reach = hn::Mul(hn::Abs(inverse[a]),
                                      hn::Set(f16, half * (1.0f + 0x1p-20f)));  // and its rounding
            in = hn::Max(in, hn::Sub(near[a], reach)), out = hn::Min(out, hn::Add(far[a], reach));
        }
        return hn::Gt(in, out);
    }

    HWY_INLINE void store(const V16 (&from)[4], float (SingleFrame::*to)[4]) {
        store_quads(from, [&](std::size_t l) { return frames_[l].*to; });
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
    const bool passing_;
    std::uint32_t pass_by_ = 0;
    SingleFrame frames_[lanes16];
    HWY_ALIGN std::int32_t codes_[lanes16];
    std::uint32_t careful_ = 0;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
