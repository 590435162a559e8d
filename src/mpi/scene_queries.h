// Queries of scenes, as kinds for rounds.h.
#pragma once

#include <raydix/error.h>
#include <raydix/mpi.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "base/distance.h"
#include "exec/parallel.h"
#include "image/surface_points.h"
#include "mpi/rank_tree.h"
#include "mpi/ray_reach.h"
#include "mpi/result_rows.h"
#include "mpi/rounds.h"
#include "mpi/scene_parts.h"

namespace raydix::mpi {

/// What the queries of a scene read on a rank.
template <class T>
struct SceneParts {
    const BasicScene<T>& scene;
    const TriangleNames& names;
    const RankTree<T>& tree;
    double ray_error;          // the greatest of all shapes and instances, on all ranks
    std::uint32_t first_path;  // paths on the ranks before this one
    int threads;

    /// Where a hit or a closest point of this rank's part is in the whole.
    template <class Place, class Named>
    void set_names(const Place& place, Named& out) const {
        if (place.instance == 0) {
            const TriangleName name = names.of(place.geometry, place.prim);
            out.geometry = name.geometry;
            out.prim = name.prim;
        } else {  // names within a scene that stands somewhere are its own
            out.geometry = place.geometry;
            out.instance = first_path + place.instance;
            out.prim = place.prim;
        }
    }
    template <class AnyHit>
    [[nodiscard]] BasicDistributedHit<T> named(const AnyHit& hit) const {
        BasicDistributedHit<T> out;
        if (!hit.hit()) return out;
        out.t = hit.t;
        out.u = hit.u;
        out.v = hit.v;
        set_names(hit, out);
        return out;
    }
};

/// The rays that this rank gave to a call, and what they see.
template <class T>
struct GivenRays {
    std::span<const BasicRay<T>> rays;
    BasicTraceOptions<T> options;

    [[nodiscard]] std::uint32_t mask(std::size_t i) const {
        return options.masks.empty() ? options.mask : options.masks[i];
    }
    /// A call and what must not differ between ranks.
    [[nodiscard]] std::string name(const char* call) const {
        return std::string(call) + (options.filter ? ", filtered" : "");
    }
    void check() const {
        if (!options.masks.empty() && options.masks.size() != rays.size())
            throw InputError(std::to_string(options.masks.size()) + " masks for " +
                             std::to_string(rays.size()) + " rays");
    }
};

/// A ray that travels.
template <class T>
struct MaskedRay {
    BasicRay<T> ray;
    std::uint32_t mask;
};
/// Rays that came from other ranks, as a scene takes them.
template <class T>
class ArrivedRays {
public:
    explicit ArrivedRays(std::span<const MaskedRay<T>> given) {
        rays_.reserve(given.size());
        for (const MaskedRay<T>& one : given) rays_.push_back(one.ray);
        const auto is_other = [&](const MaskedRay<T>& one) { return one.mask != given[0].mask; };
        if (given.empty() || std::none_of(given.begin(), given.end(), is_other)) {
            if (!given.empty()) options_.mask = given[0].mask;
            return;
        }
        masks_.reserve(given.size());
        for (const MaskedRay<T>& one : given) masks_.push_back(one.mask);
    }
    [[nodiscard]] std::span<const BasicRay<T>> rays() const { return rays_; }
    [[nodiscard]] BasicSceneTraceOptions<T> options(int threads) const {
        BasicSceneTraceOptions<T> options = options_;
        options.masks = masks_;
        options.threads = threads;
        return options;
    }

private:
    std::vector<BasicRay<T>> rays_;
    std::vector<std::uint32_t> masks_;  // empty where one serves all
    BasicSceneTraceOptions<T> options_;
};

template <class T>
[[nodiscard]] auto order_of(const BasicDistributedHit<T>& hit) {
    return std::tuple(hit.t, hit.instance, hit.geometry, hit.prim);
}

/// What all rays share: they reach the boxes that they go through.
template <class T>
class RayKind {
public:
    using Scalar = T;
    using Question = MaskedRay<T>;

    RayKind(const SceneParts<T>& parts, const GivenRays<T>& given)
        : parts_(parts), given_(given), rays_(given.rays) {}
    [[nodiscard]] std::size_t size() const { return rays_.size(); }
    [[nodiscard]] Question question(std::size_t i) const { return {rays_[i], given_.mask(i)}; }

protected:
    [[nodiscard]] bool first_within(std::size_t i, T most, Candidate<T>& found) const {
        if (!is_valid(rays_[i])) return false;
        return parts_.tree.first(most, reach_of(i), found);
    }
    void reach_within(std::size_t i, T most, std::vector<Candidate<T>>& found) const {
        found.clear();
        if (is_valid(rays_[i])) parts_.tree.all(most, reach_of(i), found);
    }
    /// What the scene of this rank is asked with.
    [[nodiscard]] BasicSceneTraceOptions<T> options_of(const ArrivedRays<T>& arrived) const {
        BasicSceneTraceOptions<T> options = arrived.options(parts_.threads);
        if (!given_.options.filter) return options;
        options.filter = [this](std::size_t, const auto& ray, const auto& hit) {
            return given_.options.filter(ray, parts_.named(hit));
        };
        return options;
    }
    [[nodiscard]] RayReach<T> reach_of(std::size_t i) const {
        return {rays_[i], parts_.tree.bounds(), parts_.ray_error};
    }
    void count(TraceCounts& counts) const {
        counts.rays = rays_.size();
        for (const auto& ray : rays_) counts.invalid_rays += !is_valid(ray);
    }

    SceneParts<T> parts_;
    GivenRays<T> given_;
    std::span<const BasicRay<T>> rays_;
};

/// Normals of hits at the queries of a call, for pictures.
template <class T>
class HitNormals {
    using Surface = std::conditional_t<sizeof(T) == 4, SceneSurface, SceneSurfaceD>;

public:
    /// normals [rays of this rank]: set where a ray hits.
    HitNormals(const BasicScene<T>& scene, std::span<Double3> normals)
        : surface_(scene), normals_(normals) {}
    /// Where a ray hit this rank's part.
    [[nodiscard]] Double3 of(const BasicRay<T>& ray, const BasicHit<T>& hit) const {
        return surface_.normal(ray, hit);
    }
    void set(std::size_t i, const Double3& normal) { normals_[i] = normal; }

private:
    Surface surface_;
    std::span<Double3> normals_;
};

/// The closest hit. Rays travel as long as their best hit so far leaves them.
template <class T>
class ClosestHitKind : public RayKind<T> {
    using Hit = BasicDistributedHit<T>;

public:
    using Question = typename RayKind<T>::Question;
    static constexpr bool asks_all = false;

    /// normals: none, or what answers come with on all ranks.
    ClosestHitKind(const SceneParts<T>& parts, const GivenRays<T>& given,
                   Answers<Hit, TraceCounts>& answers, HitNormals<T>* normals = nullptr)
        : RayKind<T>(parts, given), answers_(answers), normals_(normals) {}

    void clear() { answers_.values.assign(this->rays_.size(), {}); }
    [[nodiscard]] bool first(std::size_t i, Candidate<T>& found) const {
        return this->first_within(i, most(i), found);
    }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        this->reach_within(i, most(i), found);
    }
    [[nodiscard]] Question question(std::size_t i) const {
        Question question = RayKind<T>::question(i);
        question.ray.tmax = most(i);
        return question;
    }
    void answer(std::span<const Question> questions) {
        const ArrivedRays<T> arrived(questions);
        found_.resize(questions.size());
        raydix::trace(this->parts_.scene, arrived.rays(), std::span(found_),
                      this->options_of(arrived));
        if (normals_ == nullptr) return;
        normals_found_.resize(found_.size());
        for (std::size_t q = 0; q < found_.size(); ++q)
            if (found_[q].hit()) normals_found_[q] = normals_->of(arrived.rays()[q], found_[q]);
    }
    [[nodiscard]] std::uint64_t most_answer_bytes() const {
        return sizeof(std::uint8_t) + sizeof(Hit) + (normals_ != nullptr ? sizeof(Double3) : 0);
    }
    void put_answer(std::size_t q, Bytes& out) const {
        const Hit hit = this->parts_.named(found_[q]);
        put(out, std::uint8_t{hit.hit()});
        if (!hit.hit()) return;
        put(out, hit.t);
        put(out, hit.u);
        put(out, hit.v);
        put(out, hit.geometry);
        put(out, hit.instance);
        put(out, hit.prim);
        if (normals_ != nullptr) put(out, normals_found_[q]);
    }
    void take(std::size_t i, Reader& reader) {
        if (reader.take<std::uint8_t>() == 0) return;
        Hit hit;
        hit.t = reader.take<T>();
        hit.u = reader.take<T>();
        hit.v = reader.take<T>();
        hit.geometry = reader.take<std::uint32_t>();
        hit.instance = reader.take<std::uint32_t>();
        hit.prim = reader.take<std::uint64_t>();
        const Double3 normal = normals_ != nullptr ? reader.take<Double3>() : Double3();
        Hit& best = answers_.values[i];
        if (best.hit() && !(order_of(hit) < order_of(best))) return;
        best = hit;
        if (normals_ != nullptr) normals_->set(i, normal);
    }
    void finish() {
        this->count(answers_.counts);
        for (const Hit& hit : answers_.values) answers_.counts.hits += hit.hit();
    }

private:
    [[nodiscard]] T most(std::size_t i) const {
        return std::min(this->rays_[i].tmax, answers_.values[i].t);
    }
    Answers<Hit, TraceCounts>& answers_;
    HitNormals<T>* normals_;
    std::vector<BasicHit<T>> found_;      // of answers
    std::vector<Double3> normals_found_;  // [found_], set where a ray hit
};

/// Any hit: one rank that says yes is enough.
template <class T>
class AnyHitKind : public RayKind<T> {
public:
    using Question = typename RayKind<T>::Question;
    static constexpr bool asks_all = false;

    AnyHitKind(const SceneParts<T>& parts, const GivenRays<T>& given,
               Answers<std::uint8_t, TraceCounts>& answers)
        : RayKind<T>(parts, given), answers_(answers) {}

    void clear() { answers_.values.assign(this->rays_.size(), 0); }
    [[nodiscard]] bool first(std::size_t i, Candidate<T>& found) const {
        return this->first_within(i, this->rays_[i].tmax, found);
    }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        found.clear();
        if (answers_.values[i] == 0) this->reach_within(i, this->rays_[i].tmax, found);
    }
    void answer(std::span<const Question> questions) {
        const ArrivedRays<T> arrived(questions);
        occluded_.resize(questions.size());
        raydix::trace_any(this->parts_.scene, arrived.rays(), std::span(occluded_),
                          this->options_of(arrived));
    }
    [[nodiscard]] static std::uint64_t most_answer_bytes() { return sizeof(std::uint8_t); }
    void put_answer(std::size_t q, Bytes& out) const { put(out, occluded_[q]); }
    void take(std::size_t i, Reader& reader) { answers_.values[i] |= reader.take<std::uint8_t>(); }
    void finish() {
        this->count(answers_.counts);
        for (const std::uint8_t one : answers_.values) answers_.counts.hits += one;
    }

private:
    Answers<std::uint8_t, TraceCounts>& answers_;
    std::vector<std::uint8_t> occluded_;  // of answers
};

template <class T>
class AllHitsKind : public RayKind<T> {
    using Hit = BasicDistributedHit<T>;

public:
    using Question = typename RayKind<T>::Question;
    static constexpr bool asks_all = true;

    AllHitsKind(const SceneParts<T>& parts, const GivenRays<T>& given, RowStore<Hit>& rows)
        : RayKind<T>(parts, given), rows_(rows) {}

    [[nodiscard]] bool first(std::size_t, Candidate<T>&) const { return false; }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        this->reach_within(i, this->rays_[i].tmax, found);
    }
    std::uint64_t answer_some(std::span<const Question> rays, std::uint64_t most, Bytes& out) {
        return answer_in_chunks(
            rays, most, out, [&](std::span<const Question> chunk, std::uint64_t limit) {
                const ArrivedRays<T> arrived(chunk);
                BasicSceneTraceOptions<T> options = this->options_of(arrived);
                options.max_result_bytes = limit;
                const auto all = raydix::trace_all(this->parts_.scene, arrived.rays(), options);
                for (std::size_t q = 0; q < chunk.size(); ++q) {
                    put(out, all.offsets[q + 1] - all.offsets[q]);
                    for (std::uint64_t k = all.offsets[q]; k < all.offsets[q + 1]; ++k)
                        put(out, this->parts_.named(all.hits[k]));
                }
            });
    }
    void take(std::size_t i, Reader& reader) { rows_.take(i, reader); }
    void finish(TraceCounts& counts) const { this->count(counts); }

private:
    RowStore<Hit>& rows_;
};

/// The closest point. Squares of distances follow from the points themselves, those of shapes too.
template <class T>
class ClosestPointKind {
    using Closest = BasicDistributedClosest<T>;
    using Point = BasicVec3<T>;

public:
    using Scalar = T;
    struct Question {
        Point at;
        T most_d2;
    };
    static constexpr bool asks_all = false;

    ClosestPointKind(const SceneParts<T>& parts, std::span<const Point> queries, T max_distance,
                     std::uint32_t mask, Answers<Closest, QueryCounts>& answers)
        : parts_(parts),
          queries_(queries),
          most_d2_(max_distance * max_distance),
          mask_(mask),
          answers_(answers) {}

    void clear() { answers_.values.assign(queries_.size(), {}); }
    [[nodiscard]] std::size_t size() const { return queries_.size(); }
    [[nodiscard]] bool first(std::size_t i, Candidate<T>& found) const {
        return is_finite(queries_[i]) && parts_.tree.first(most(i), bound_of(i), found);
    }
    void reach(std::size_t i, std::vector<Candidate<T>>& found) const {
        parts_.tree.all(most(i), bound_of(i), found);
    }
    [[nodiscard]] Question question(std::size_t i) const { return {queries_[i], most(i)}; }

    void answer(std::span<const Question> questions) {
        found_.resize(questions.size());
        with_threads(parts_.threads, [&] {
            for_each_index(
                questions.size(),
                [&](std::size_t q) {
                    found_[q] = closest_point(parts_.scene, questions[q].at,
                                              radius_of(questions[q].most_d2), mask_);
                },
                64);
        });
    }
    [[nodiscard]] static std::uint64_t most_answer_bytes() {
        return sizeof(std::uint8_t) + sizeof(Closest);
    }
    void put_answer(std::size_t q, Bytes& out) const {
        const BasicSceneClosestPoint<T>& one = found_[q];
        put(out, std::uint8_t{one.found()});
        if (!one.found()) return;
        Closest named{one.position, one.distance, one.u, one.v};
        parts_.set_names(one, named);
        put(out, named);
    }
    void take(std::size_t i, Reader& reader) {
        if (reader.take<std::uint8_t>() == 0) return;
        const auto one = reader.take<Closest>();
        Closest& best = answers_.values[i];
        if (!(d2_of(i, one) <= most_d2_)) return;
        if (!best.found() || order(i, one) < order(i, best)) best = one;
    }
    void finish() {
        answers_.counts.queries = queries_.size();
        for (std::size_t i = 0; i < queries_.size(); ++i) {
            answers_.counts.found += answers_.values[i].found();
            answers_.counts.invalid_queries += !is_finite(queries_[i]);
        }
    }

private:
    [[nodiscard]] T d2_of(std::size_t i, const Closest& one) const {
        return squared_distance(queries_[i], one.position);
    }
    [[nodiscard]] auto order(std::size_t i, const Closest& one) const {
        return std::tuple(d2_of(i, one), one.instance, one.geometry, one.prim);
    }
    [[nodiscard]] T most(std::size_t i) const {
        const Closest& best = answers_.values[i];
        return best.found() ? d2_of(i, best) : most_d2_;
    }
    /// A radius whose square is not below d2.
    [[nodiscard]] static T radius_of(T d2) {
        return std::nextafter(std::sqrt(d2), std::numeric_limits<T>::infinity());
    }
    [[nodiscard]] auto bound_of(std::size_t i) const {
        return [query = &queries_[i].x](const RankBox<T>& box) { return least_d2(query, box); };
    }

    SceneParts<T> parts_;
    std::span<const Point> queries_;
    T most_d2_;
    std::uint32_t mask_;
    Answers<Closest, QueryCounts>& answers_;
    std::vector<BasicSceneClosestPoint<T>> found_;  // of answers
};

}  // namespace raydix::mpi
