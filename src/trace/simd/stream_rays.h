// Rays of a stream and the lists of them that nodes hold.
#pragma once

#include <cstdint>
#include <vector>

#include "trace/simd/ray_classes.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

/// 64 bytes of constants in fours, as load_quads reads them, and what was found.
struct alignas(32) StreamRay {
    float quad[4][4];  // origin, t | limited inverse, tmin | shear x, y, unused | inverse, unused
    std::uint32_t prim;
    float u, v;
    std::uint32_t index;  // of the ray in its job

    [[nodiscard]] float& t() { return quad[0][3]; }
    [[nodiscard]] float t() const { return quad[0][3]; }
    /// Any hit will do, and there is one: no box is near enough any more.
    void settle() { prim = 0, t() = -1.0f; }
    /// t is at most t(); at equal t the lower primitive wins.
    void take(bool any, float new_t, std::uint32_t new_prim, float new_u, float new_v) {
        if (any) {
            settle();
        } else if (new_t < t() || new_prim < prim) {
            t() = new_t, prim = new_prim, u = new_u, v = new_v;
        }
    }
};
static_assert(sizeof(StreamRay) == 96);

/// What all rays of a stream share.
struct StreamFrame {
    RayClass kind;
    float near_pad[3];  // with the sign that moves near planes toward the ray's start

    [[nodiscard]] RayFrame frame_of(const StreamRay& ray) const {
        RayFrame frame;
        frame.origin = {ray.quad[0][0], ray.quad[0][1], ray.quad[0][2]};
        frame.inverse = {ray.quad[3][0], ray.quad[3][1], ray.quad[3][2]};
        frame.kx = static_cast<int>(kind.kx), frame.ky = static_cast<int>(kind.ky),
        frame.kz = static_cast<int>(kind.kz);
        frame.shear_x = ray.quad[2][0], frame.shear_y = ray.quad[2][1];
        frame.shear_z = ray.quad[3][kind.kz];
        frame.tmin = ray.quad[1][3], frame.tmax = ray.t();
        frame.t_scale = 1.0f;
        return frame;
    }
    [[nodiscard]] WideRay wide_ray_of(const StreamRay& ray) const {
        return {{ray.quad[1][0], ray.quad[1][1], ray.quad[1][2]},
                {near_pad[0], near_pad[1], near_pad[2]},
                kind.negatives};
    }
};

struct StreamEntry {
    std::uint32_t word, begin, count;
};

/// Lists live in one array: those of a node's children stand behind the node's own, and go when it
/// is done. It grows when a visit may need more.
class StreamMemory {
public:
    static constexpr std::uint32_t slack = 16;  // behind a list: whole vectors are read and written

    [[nodiscard]] std::uint32_t* lists() { return lists_.data(); }
    [[nodiscard]] std::vector<StreamEntry>& stack() { return stack_; }
    [[nodiscard]] std::vector<StreamRay>& rays() { return rays_; }
    /// Room for `count` items from `begin` on, with slack.
    void reserve(std::uint32_t begin, std::uint32_t count) {
        const std::size_t wanted = std::size_t{begin} + count + slack;
        if (wanted > lists_.size()) lists_.resize(wanted + wanted / 2);
    }

private:
    std::vector<std::uint32_t> lists_;
    std::vector<StreamEntry> stack_;
    std::vector<StreamRay> rays_;
};

}  // namespace raydix
