// Rays of a stream and the lists of them that nodes hold.
#pragma once

#include <cstdint>
#include <vector>

#include "trace/simd/ray_classes.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

/// A cache line: what load_quads reads in fours.
struct alignas(64) StreamRay {
    float origin[3], t;
    float inverse[3], tmin;  // limited
    // Of triangles: the shear of x and y, the direction along kz, and tmin once more.
    float shear[2], way, first;
    float direction[3];
    std::uint32_t prim;

    /// Any hit will do, and there is one: no box is near enough any more.
    void settle() { prim = 0, t = -1.0f; }
};
static_assert(sizeof(StreamRay) == 64);

struct StreamHit {
    float u, v;
};

/// What all rays of a stream share.
struct StreamFrame {
    RayClass kind;
    float near_pad[4];  // with the sign that moves near planes toward the ray's start

    [[nodiscard]] TriangleRay triangle_ray(const StreamRay& ray) const {
        return triangle_ray_of(kind, {ray.origin[0], ray.origin[1], ray.origin[2]},
                               {ray.direction[0], ray.direction[1], ray.direction[2]}, ray.shear[0],
                               ray.shear[1], ray.tmin);
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
    [[nodiscard]] std::vector<StreamHit>& hits() { return hits_; }
    [[nodiscard]] std::vector<std::uint32_t>& going() { return going_; }
    /// Room for `count` items from `begin` on, with slack.
    void reserve(std::uint32_t begin, std::uint32_t count) {
        const std::size_t wanted = std::size_t{begin} + count + slack;
        if (wanted > lists_.size()) lists_.resize(wanted + wanted / 2);
    }

private:
    std::vector<std::uint32_t> lists_;
    std::vector<StreamEntry> stack_;
    std::vector<StreamRay> rays_;
    std::vector<StreamHit> hits_;
    std::vector<std::uint32_t> going_;
};

}  // namespace raydix
