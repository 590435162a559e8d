// Batches -> packets: rays are sorted by class within a block, and a packet's rays become arrays.
// Included once per instruction set by simd_kernels.cpp.
#if defined(RAYDIX_SIMD_PACKETS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_PACKETS_H
#undef RAYDIX_SIMD_PACKETS_H
#else
#define RAYDIX_SIMD_PACKETS_H
#endif

#include <hwy/cache_control.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>

#include "trace/simd/packet.h"
#include "trace/simd/ray_vectors.h"
#include "trace/simd/single_calls.h"
#include "trace/simd/stream.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

inline constexpr int ray_tmin = 3, ray_direction = 4, ray_tmax = 7;  // floats of a Ray

/// The largest pad of make_slab_frame over rays whose origins lie between `least` and `largest`,
/// times `factor`; positive.
inline void largest_pad(const WideView& tree, const float* least, const float* largest,
                        std::uint32_t kz, float factor, float* pad, PadGrowth growth = {}) {
    float far[3];
    for (int a = 0; a < 3; ++a) {
        const float lo = tree.lo[a], hi = tree.hi[a];
        far[a] = max_of(max_of(std::fabs(lo - least[a]), std::fabs(lo - largest[a])),
                        max_of(std::fabs(hi - least[a]), std::fabs(hi - largest[a])));
    }
    const float grown = growth.rate * max_of(max_of(far[0], far[1]), far[2]) + growth.least;
    for (int a = 0; a < 3; ++a)
        pad[a] = factor * slab_pad * (far[a] + far[kz]) + least_slab_pad + grown;
}

/// Rays of a packet, a vector of them each; those beyond the packet's count repeat others.
using PacketRays = std::array<RayVectors, packet_size / lanes16>;

/// Rays index[0, count) of `rays`; `index` is read up to the next multiple of lanes16.
HWY_INLINE void read_packet(const Ray* rays, const std::int32_t* index, std::uint32_t count,
                            PacketRays& to) {
    for (std::size_t i = 0; i < count; i += lanes16) to[i / lanes16] = read_rays(rays, index + i);
}

/// `count` rays of one class.
inline HWY_NOINLINE void fill_packet(const WideView& tree, const PacketRays& rays,
                                     std::uint32_t count, std::uint32_t code, Packet& p,
                                     PadGrowth growth = {}) {
    using V = V16;
    p.count = count;
    p.kind = ray_class_of(code);
    V origin_lo[3], origin_hi[3], least[3], largest[3];
    for (int a = 0; a < 3; ++a) {
        origin_lo[a] = least[a] = hn::Set(f16, infinity);
        origin_hi[a] = hn::Set(f16, -infinity);
        largest[a] = hn::Zero(f16);
    }
    V least_tmin = hn::Set(f16, infinity);
    for (std::size_t i = 0; i < packet_size; i += lanes16) {
        if (i >= count) {
            hn::Store(hn::Set(f16, -infinity), f16, p.t + i);
            continue;
        }
        const RayVectors& ray = rays[i / lanes16];
        for (int a = 0; a < 3; ++a) {
            const V o = hn::Add(ray.place[a], hn::Zero(f16));  // -0 becomes +0
            hn::Store(o, f16, p.origin[a] + i);
            origin_lo[a] = hn::Min(origin_lo[a], o);
            origin_hi[a] = hn::Max(origin_hi[a], o);
            hn::Store(ray.way[a], f16, p.direction[a] + i);
            const V inverse = hn::Div(hn::Set(f16, 1.0f), ray.way[a]);
            const V limit = hn::Set(f16, wide_longest_inverse);
            const V limited = hn::Max(hn::Min(inverse, limit), hn::Neg(limit));
            hn::Store(limited, f16, p.inverse[a] + i);
            least[a] = hn::Min(least[a], hn::Abs(limited));
            largest[a] = hn::Max(largest[a], hn::Abs(limited));
        }
        const V depth = ray.way[p.kind.kz];
        hn::Store(hn::Div(ray.way[p.kind.kx], depth), f16, p.shear_x + i);
        hn::Store(hn::Div(ray.way[p.kind.ky], depth), f16, p.shear_y + i);
        const V tmin = ray.place[3];
        const V start = hn::IfThenElseZero(hn::Gt(tmin, hn::Zero(f16)), tmin);
        hn::Store(start, f16, p.tmin + i);
        least_tmin = hn::Min(least_tmin, start);
        const V reach = hn::Min(ray.way[3], hn::Set(f16, std::numeric_limits<float>::max()));
        hn::Store(hn::IfThenElse(hn::FirstN(f16, count - i), reach, hn::Set(f16, -infinity)), f16,
                  p.t + i);
        hn::Store(hn::Set(U16(), no_primitive), U16(), p.prim + i);
    }
    for (int a = 0; a < 3; ++a) {
        p.origin_lo[a] = hn::GetLane(hn::MinOfLanes(f16, origin_lo[a]));
        p.origin_hi[a] = hn::GetLane(hn::MaxOfLanes(f16, origin_hi[a]));
        p.least_inverse[a] = hn::GetLane(hn::MinOfLanes(f16, least[a]));
        p.largest_inverse[a] = hn::GetLane(hn::MaxOfLanes(f16, largest[a]));
    }
    p.one_origin = true;
    for (int a = 0; a < 3; ++a) p.one_origin = p.one_origin && p.origin_lo[a] == p.origin_hi[a];
    p.least_tmin = hn::GetLane(hn::MinOfLanes(f16, least_tmin));
    largest_pad(tree, p.origin_lo, p.origin_hi, p.kind.kz, packet_pad_factor, p.pad, growth);
    for (int a = 0; a < 3; ++a) {
        const V pad = hn::Set(f16, p.kind.negative(a) ? p.pad[a] : -p.pad[a]);
        for (std::size_t i = 0; i < count; i += lanes16) {
            const V from = hn::Sub(hn::Set(f16, tree.middle[a]), hn::Load(f16, p.origin[a] + i));
            const V inverse = hn::Load(f16, p.inverse[a] + i);
            hn::Store(hn::Mul(hn::Add(from, pad), inverse), f16, p.near[a] + i);
            hn::Store(hn::Mul(hn::Sub(from, pad), inverse), f16, p.far[a] + i);
        }
    }
}

/// Rays of a job by class: order[begin[c]] to order[begin[c + 1]], each class in the caller's
/// order and followed by room for a vector.
class RaySorter {
public:
    static constexpr std::size_t max_rays = max_job_rays;

    void sort(const SimdJob& job) {
        if (job.order == nullptr)
            sort_by([](std::size_t k) { return static_cast<std::int32_t>(k); }, job);
        else
            sort_by(
                [order = job.order](std::size_t k) { return static_cast<std::int32_t>(order[k]); },
                job);
    }
    [[nodiscard]] const std::int32_t* rays(std::uint32_t code) const {
        return order_ + begin_[code];
    }
    [[nodiscard]] std::uint32_t count(std::uint32_t code) const { return count_[code]; }

private:
    using Bytes = hn::Rebind<std::uint8_t, I16>;
    /// Behind a class: what whole vectors write, and what fills the last one.
    static constexpr std::uint32_t slack = 32;

    /// Calls each(code, lanes with that code) for the first `count` of `codes`, which `bytes` are
    /// as well, if neighbours mostly agree. If not that takes as long as there are codes among
    /// them: then one(lane) for each.
    template <class Each, class One>
    static HWY_INLINE void for_each_code(hn::Vec<I16> codes, const std::uint8_t* bytes,
                                         std::size_t count, const Each& each, const One& one) {
        auto lanes = static_cast<std::uint32_t>((std::uint64_t{1} << count) - 1);
        const auto agreeing = [&](std::uint32_t code) {
            return bits_of(I16(), hn::Eq(codes, hn::Set(I16(), static_cast<std::int32_t>(code)))) &
                   lanes;
        };
        if (2 * static_cast<std::size_t>(std::popcount(agreeing(bytes[0]))) < count) {
            for (std::size_t l = 0; l < count; ++l) one(l);
            return;
        }
        while (lanes != 0) {
            const std::uint8_t code = bytes[std::countr_zero(lanes)];
            const std::uint32_t met = agreeing(code);
            each(code, met);
            lanes &= ~met;
        }
    }

    /// `place_of` is where ray k of the job lies.
    template <class PlaceOf>
    HWY_INLINE void sort_by(const PlaceOf& place_of, const SimdJob& job) {
        const Ray* const rays = job.rays;
        const std::size_t n = job.n, last = n - 1;
        HWY_ALIGN std::int32_t index[16];
        std::uint32_t counts[ray_class_count] = {};
        for (std::size_t k = 0; k < n; k += lanes16) {
            for (std::size_t l = 0; l < lanes16; ++l) index[l] = place_of(std::min(k + l, last));
            for (std::size_t l = 0; l < lanes16; ++l)
                hwy::Prefetch(rays + place_of(std::min(k + l + 128, last)));
            const auto codes = classify(read_rays(rays, index));
            hn::StoreU(hn::DemoteTo(Bytes(), codes), Bytes(), code_ + k);
            for_each_code(
                codes, code_ + k, std::min(n - k, lanes16),
                [&](std::uint8_t code, std::uint32_t lanes) {
                    counts[code] += static_cast<std::uint32_t>(std::popcount(lanes));
                },
                [&](std::size_t l) { ++counts[code_[k + l]]; });
        }
        std::uint32_t at = 0, next[ray_class_count];
        for (std::uint32_t c = 0; c < ray_class_count; ++c) {
            begin_[c] = next[c] = at;
            count_[c] = counts[c];
            if (counts[c] != 0) at += counts[c] + slack;
        }
        for (std::size_t k = 0; k < n; k += lanes16) {
            for (std::size_t l = 0; l < lanes16; ++l) index[l] = place_of(std::min(k + l, last));
            const auto places = hn::Load(I16(), index);
            const auto codes = hn::PromoteTo(I16(), hn::LoadU(Bytes(), code_ + k));
            for_each_code(
                codes, code_ + k, std::min(n - k, lanes16),
                [&](std::uint8_t code, std::uint32_t lanes) {
                    const auto mask = mask_of(I16(), lanes);
                    hn::StoreU(compress(I16(), places, mask, lanes), I16(), order_ + next[code]);
                    next[code] += static_cast<std::uint32_t>(std::popcount(lanes));
                },
                [&](std::size_t l) { order_[next[code_[k + l]]++] = index[l]; });
        }
        for (std::uint32_t c = 0; c < ray_class_count; ++c)  // the last ray again, to fill vectors
            if (counts[c] != 0) std::fill_n(order_ + next[c], lanes16, order_[next[c] - 1]);
    }

    std::uint32_t begin_[ray_class_count], count_[ray_class_count];
    std::uint8_t code_[max_rays];
    HWY_ALIGN std::int32_t order_[max_rays + slack * ray_class_count];
};

/// t, prim, u, v and the geometry of lanes16 rays -> as many Hits from `to` on. False, and nothing
/// stored: not with this instruction set.
HWY_INLINE bool store_scene_hits(const V16 (&hit)[4], V16 geometry, TreeHit* to) {
#if HWY_TARGET == HWY_AVX3
    // Of a hit in words of 64 bits: t and prim, u and v, the geometry and 0. Eight hits a vector,
    // two of them of each 128 bits of what is interleaved.
    const __m512i lower = _mm512_set_epi64(11, 10, 3, 2, 9, 8, 1, 0),
                  upper = _mm512_set_epi64(15, 14, 7, 6, 13, 12, 5, 4);
    const auto words = [&](V16 even, V16 odd, __m512i half) {
        return _mm512_permutex2var_epi64(
            _mm512_castps_si512(_mm512_unpacklo_ps(even.raw, odd.raw)), half,
            _mm512_castps_si512(_mm512_unpackhi_ps(even.raw, odd.raw)));
    };
    // The first two of words 8 k to 8 k + 7 of eight hits, and where the third comes in.
    const __m512i first[3] = {_mm512_set_epi64(10, 2, 0, 9, 1, 0, 8, 0),
                              _mm512_set_epi64(5, 0, 12, 4, 0, 11, 3, 0),
                              _mm512_set_epi64(0, 15, 7, 0, 14, 6, 0, 13)};
    const __m512i third[3] = {_mm512_set_epi64(0, 0, 1, 0, 0, 0, 0, 0),
                              _mm512_set_epi64(0, 4, 0, 0, 3, 0, 0, 2),
                              _mm512_set_epi64(7, 0, 0, 6, 0, 0, 5, 0)};
    constexpr __mmask8 places[3] = {0b00100100, 0b01001001, 0b10010010};
    auto* out = reinterpret_cast<char*>(to);
    for (const __m512i& half : {lower, upper}) {
        const __m512i a = words(hit[0], hit[1], half), b = words(hit[2], hit[3], half),
                      c = words(geometry, hn::Zero(f16), half);
        for (int k = 0; k < 3; ++k, out += 64) {
            const __m512i ab = _mm512_permutex2var_epi64(a, first[k], b);
            _mm512_storeu_si512(out, _mm512_mask_permutexvar_epi64(ab, places[k], third[k], c));
        }
    }
    return true;
#else
    static_cast<void>(hit), static_cast<void>(geometry), static_cast<void>(to);
    return false;
#endif
}

template <Wanted query>
HWY_INLINE void store_packet(const SimdJob& job, const std::int32_t* index, bool in_order,
                             const Packet& p, std::uint64_t found, SimdCounts& counts) {
    counts.hits += static_cast<std::uint64_t>(std::popcount(found));
    if constexpr (wants_any(query)) {
        for (std::uint32_t k = 0; k < p.count; ++k) job.occluded[index[k]] = found >> k & 1;
        return;
    }
    std::uint32_t k = 0;
    for (; k + lanes16 <= p.count; k += lanes16) {
        const auto prim = hn::Load(U16(), p.prim + k);
        const auto hit = hn::RebindMask(f16, hn::Ne(prim, hn::Set(U16(), no_primitive)));
        const V16 out[4] = {hn::IfThenElse(hit, hn::Load(f16, p.t + k), hn::Set(f16, infinity)),
                            hn::BitCast(f16, prim), hn::IfThenElseZero(hit, hn::Load(f16, p.u + k)),
                            hn::IfThenElseZero(hit, hn::Load(f16, p.v + k))};
        const auto geometry =
            hn::IfThenElse(hn::RebindMask(U16(), hit), hn::Set(U16(), job.hits.geometry()), prim);
        if (in_order && job.hits.of_scene() &&
            store_scene_hits(out, hn::BitCast(f16, geometry), job.hits.at(k)))
            continue;
        store_quads(out, [&](std::size_t l) {
            return reinterpret_cast<float*>(job.hits.at(static_cast<std::size_t>(index[k + l])));
        });
        if (!job.hits.of_scene()) continue;
        HWY_ALIGN std::uint32_t geometries[lanes16];
        hn::Store(geometry, U16(), geometries);
        for (std::size_t l = 0; l < lanes16; ++l)
            job.hits.put_place(static_cast<std::size_t>(index[k + l]), geometries[l]);
    }
    for (; k < p.count; ++k)
        job.hits.put(
            static_cast<std::size_t>(index[k]),
            p.prim[k] != no_primitive ? TreeHit{p.t[k], p.prim[k], p.u[k], p.v[k]} : TreeHit{});
}

/// The rays of a job in packets.
template <Wanted query>
class PacketJob {
    static constexpr bool any = wants_any(query), all = query == Wanted::all;

public:
    PacketJob(const SimdJob& job, SimdCounts& counts)
        : job_(job), counts_(counts), ahead_(job.rays + job.n) {
        if constexpr (all) before_ = job.all->size();
        std::iota(index_, index_ + packet_size, 0);
    }

    /// Windows of one class go as they are; most of primary rays are such. The others wait until
    /// those are done, and are then sorted by class. Where half of the windows are mixed, all rays
    /// that are left are sorted; so they are from the first mixed one on if all hits are wanted,
    /// since these are found in order.
    void trace() {
        const SimdJob whole = job_;
        std::size_t windows = 0, mixed = 0, place = 0;
        while (job_.n > 0) {
            const std::size_t count = std::min(job_.n, packet_size);
            ++windows;
            if (!trace_window()) {
                ++mixed;
                if (all || 2 * mixed > windows + 2) break;
                put_off(place, count);
            }
            place += count;
            leave_behind(count);
        }
        if constexpr (!all) {
            put_off(place, job_.n);
            job_ = whole;
            job_.order = later_, job_.n = later_count_;
        }
        if (job_.n > 0) trace_sorted();
    }

private:
    /// The first 64 rays, or all; false if they are not of one class.
    HWY_INLINE bool trace_window() {
        const std::size_t count = std::min(job_.n, packet_size);
        if (job_.order != nullptr) std::copy_n(job_.order, count, index_);
        // The last ray again, to fill the vector.
        for (std::size_t k = count; k % lanes16 != 0; ++k) index_[k] = index_[count - 1];
        PacketRays rays;
        std::uint32_t code = 0;
        for (std::size_t i = 0; i < count; i += lanes16) {
            RayVectors& here = rays[i / lanes16];
            here = read_rays(job_.rays, index_ + i);
            const auto codes = classify(here);
            if (i == 0) code = static_cast<std::uint32_t>(hn::GetLane(codes));
            const auto same = hn::Eq(codes, hn::Set(I16(), static_cast<std::int32_t>(code)));
            if (code == odd_ray_class || !hn::AllTrue(I16(), same)) return false;
        }
        trace_packet(rays, index_, static_cast<std::uint32_t>(count), code);
        return true;
    }

    /// The next `count` rays, of which the first is the job's ray `place`.
    void put_off(std::size_t place, std::size_t count) {
        for (std::size_t k = 0; k < count; ++k)
            later_[later_count_++] =
                job_.order == nullptr ? static_cast<std::uint32_t>(place + k) : job_.order[k];
    }

    void leave_behind(std::size_t count) {
        job_.n -= count;
        if (job_.order != nullptr) {
            job_.order += count;
            return;
        }
        job_.rays += count;
        if constexpr (all) {
            counts_.hits += group_by_ray(*job_.all, before_, count, job_.hit_counts);
            before_ = job_.all->size();
            job_.hit_counts += count;
        } else if constexpr (any)
            job_.occluded += count;
        else
            job_.hits = job_.hits.from(count);
    }

    void trace_sorted() {
        RaySorter sorter;
        sorter.sort(job_);
        for (std::uint32_t code = 0; code < odd_ray_class; ++code) {
            const std::int32_t* const rays = sorter.rays(code);
            for (std::uint32_t at = 0; at < sorter.count(code); at += packet_size) {
                const std::int32_t* const index = rays + at;
                const auto count = std::min<std::uint32_t>(packet_size, sorter.count(code) - at);
                PacketRays read;
                read_packet(job_.rays, index, count, read);
                trace_packet(read, index, count, code);
            }
        }
        const std::int32_t* const odd = sorter.rays(odd_ray_class);
        for (std::uint32_t k = 0; k < sorter.count(odd_ray_class); ++k) {
            const auto i = static_cast<std::size_t>(odd[k]);
            by_layout(job_.tree,
                      [&](auto compact) { trace_one<query, true, compact>(job_, i, counts_); });
        }
        if constexpr (all)
            counts_.hits += group_by_ray(*job_.all, before_, job_.n, job_.hit_counts);
    }

    HWY_NOINLINE void trace_packet(const PacketRays& rays, const std::int32_t* index,
                                   std::uint32_t count, std::uint32_t code) {
        if (job_.order == nullptr) {
            // What the next job will read first, while there is something to do.
            for (std::uint32_t k = 0; k < count; k += 2) hwy::Prefetch(ahead_ + k);
            ahead_ += count;
        }
        fill_packet(job_.tree, rays, count, code, packet_);
        std::uint64_t found = 0;
        with_constants(job_, [&](auto counting, auto compact) {
            // All hits and accepted ones are always counted.
            constexpr bool counts = counting || all || wants_accepted(query);
            PacketWalk<query, counts, compact> walk(job_.tree, packet_, job_.rays, index,
                                                    job_.packet_stack, counts_, job_.all,
                                                    job_.check);
            walk.trace();
            found = walk.found();
        });
        if constexpr (!all)
            store_packet<query>(job_, index, index == index_ && job_.order == nullptr, packet_,
                                found, counts_);
    }

    SimdJob job_;             // what is left of it
    std::size_t before_ = 0;  // of all hits, those of rays that are left behind
    SimdCounts& counts_;
    const Ray* ahead_;
    HWY_ALIGN std::int32_t index_[packet_size];
    Packet packet_;
    std::size_t later_count_ = 0;
    std::uint32_t later_[max_job_rays];
};

template <Wanted query>
void trace_packets(const SimdJob& job, SimdCounts& counts) {
    PacketJob<query>(job, counts).trace();
}

/// Rays index[0, count) of one class as a stream; `index` may be read up to the next multiple of
/// lanes16.
inline HWY_NOINLINE StreamFrame fill_stream(const SimdJob& job, const std::int32_t* index,
                                            std::uint32_t count, std::uint32_t code,
                                            PadGrowth growth = {}) {
    std::vector<StreamRay>& rays = job.memory->rays();
    StreamFrame frame;
    frame.kind = ray_class_of(code);
    rays.resize((count + lanes16 - 1) / lanes16 * lanes16);
    job.memory->hits().resize(count);
    V16 lo[3], hi[3];
    for (int a = 0; a < 3; ++a) lo[a] = hn::Set(f16, infinity), hi[a] = hn::Set(f16, -infinity);
    const V16 zero = hn::Zero(f16), one = hn::Set(f16, 1.0f),
              limit = hn::Set(f16, wide_longest_inverse);
    for (std::uint32_t k = 0; k < count; k += lanes16) {
        for (std::size_t l = 0; l < lanes16; ++l)
            hwy::Prefetch(job.rays + index[std::min<std::size_t>(k + lanes16 + l, count - 1)]);
        const RayVectors ray = read_rays(job.rays, index + k);
        V16 place[4], way[4], shear[4], direction[4];
        for (int a = 0; a < 3; ++a) {
            place[a] = hn::Add(ray.place[a], zero);  // -0 becomes +0
            lo[a] = hn::Min(lo[a], place[a]), hi[a] = hn::Max(hi[a], place[a]);
            direction[a] = ray.way[a];
            way[a] = hn::Max(hn::Min(hn::Div(one, ray.way[a]), limit), hn::Neg(limit));
        }
        place[3] = hn::Min(ray.way[3], hn::Set(f16, std::numeric_limits<float>::max()));
        way[3] = hn::IfThenElseZero(hn::Gt(ray.place[3], zero), ray.place[3]);
        shear[0] = hn::Div(ray.way[frame.kind.kx], ray.way[frame.kind.kz]);
        shear[1] = hn::Div(ray.way[frame.kind.ky], ray.way[frame.kind.kz]);
        shear[2] = ray.way[frame.kind.kz];
        shear[3] = way[3];
        direction[3] = hn::BitCast(f16, hn::Set(U16(), no_primitive));
        const auto quad = [to = reinterpret_cast<float*>(rays.data() + k)](std::size_t q) {
            return
                [=](std::size_t l) { return to + sizeof(StreamRay) / sizeof(float) * l + 4 * q; };
        };
        store_quads(place, quad(0));
        store_quads(way, quad(1));
        store_quads(shear, quad(2));
        store_quads(direction, quad(3));
    }
    rays.resize(count);
    float least[3], largest[3];
    for (int a = 0; a < 3; ++a) {
        least[a] = hn::GetLane(hn::MinOfLanes(f16, lo[a]));
        largest[a] = hn::GetLane(hn::MaxOfLanes(f16, hi[a]));
    }
    largest_pad(job.tree, least, largest, frame.kind.kz, wide_pad_factor, frame.near_pad, growth);
    for (int a = 0; a < 3; ++a)
        if (!frame.kind.negative(a)) frame.near_pad[a] = -frame.near_pad[a];
    return frame;
}

template <bool any>
void trace_streams(const SimdJob& job, SimdCounts& counts) {
    RaySorter sorter;
    sorter.sort(job);
    for (std::uint32_t code = 0; code < odd_ray_class; ++code) {
        const std::uint32_t count = sorter.count(code);
        if (count == 0) continue;
        const std::int32_t* index = sorter.rays(code);
        const StreamFrame frame = fill_stream(job, index, count, code);
        by_layout(job.tree, [&](auto compact) {
            StreamWalk<any, true, compact>(job.tree, frame, *job.memory, job.stack, counts).trace();
        });
        const StreamHit* found = job.memory->hits().data();
        for (const StreamRay& ray : job.memory->rays()) {
            const bool hit = ray.prim != no_primitive;
            counts.hits += hit;
            if constexpr (any)
                job.occluded[*index] = hit;
            else
                job.hits.put(static_cast<std::size_t>(*index),
                             hit ? TreeHit{ray.t, ray.prim, found->u, found->v} : TreeHit{});
            ++found, ++index;
        }
    }
    const std::int32_t* const odd = sorter.rays(odd_ray_class);
    for (std::uint32_t k = 0; k < sorter.count(odd_ray_class); ++k)
        by_layout(job.tree, [&](auto compact) {
            trace_one<any ? Wanted::any : Wanted::closest, true, compact>(
                job, static_cast<std::size_t>(odd[k]), counts);
        });
}

inline void streams(const SimdJob& job, SimdCounts& counts) {
    !job.hits ? trace_streams<true>(job, counts) : trace_streams<false>(job, counts);
}

inline void packets(const SimdJob& job, SimdCounts& counts) {
    if (job.all != nullptr) return trace_packets<Wanted::all>(job, counts);
    if (job.check != nullptr)
        return job.hits ? trace_packets<Wanted::closest_accepted>(job, counts)
                        : trace_packets<Wanted::any_accepted>(job, counts);
    job.hits ? trace_packets<Wanted::closest>(job, counts)
             : trace_packets<Wanted::any>(job, counts);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
