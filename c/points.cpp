// Points of the C interface, in float and double.
#include <limits>

#include "inside.h"

namespace raydix_c {

constexpr float unlimited = std::numeric_limits<float>::infinity();

raydix::PointQueryOptions with_threads(int threads) {
    raydix::PointQueryOptions options;
    options.threads = threads;
    return options;
}

template <class Scalar>
std::span<const raydix::BasicVec3<Scalar>> points_at(const Scalar* numbers, std::size_t count,
                                                     const char* name) {
    return array_of<raydix::BasicVec3<Scalar>>(numbers, count, name);
}

template <class Handle, class Scalar>
raydix_status create_points(const Scalar* points, std::size_t count, int threads, Handle** index) {
    return guarded([&] {
        require(index, "index");
        raydix::PointsOptions options;
        options.threads = threads;
        *index = new Handle{raydix::build_points(points_at(points, count, "points"), options)};
    });
}

raydix_status size_of_points(const auto* index, std::size_t* size) {
    return guarded([&] {
        require(index, "index");
        require(size, "size");
        *size = index->index.size();
    });
}

template <class Scalar>
raydix_status knn(const auto* index, const Scalar* queries, std::size_t count, std::uint32_t k,
                  Scalar max_distance, std::uint32_t* indices, Scalar* distances, int threads) {
    return guarded([&] {
        require(index, "index");
        raydix::PointQueryOptions options = with_threads(threads);
        options.max_distance = max_distance;
        if (k != 0) require_countable(count, k, "count * k");
        const std::size_t size = count * k;
        raydix::knn(index->index, points_at(queries, count, "queries"), k,
                    results_at<std::uint32_t>(indices, size, "indices"),
                    results_at<Scalar>(distances, size, "distances"), options);
    });
}

template <class Scalar>
raydix_status count_points(const auto* index, const Scalar* queries, std::size_t count,
                           Scalar radius, std::uint32_t* counts, int threads) {
    return guarded([&] {
        require(index, "index");
        raydix::radius_count(index->index, points_at(queries, count, "queries"), radius,
                             results_at<std::uint32_t>(counts, count, "counts"),
                             with_threads(threads));
    });
}

template <class Lists, class Scalar>
raydix_status points_within(const auto* index, const Scalar* queries, std::size_t count,
                            Scalar radius, bool sorted, std::uint64_t max_result_bytes, int threads,
                            Lists** lists) {
    return guarded([&] {
        require(index, "index");
        require(lists, "lists");
        raydix::PointQueryOptions options = with_threads(threads);
        options.sort = sorted;
        options.max_result_bytes = max_result_bytes;
        const auto asked = points_at(queries, count, "queries");
        *lists = new Lists{raydix::radius_search(index->index, asked, radius, options)};
    });
}

template <class Scalar>
raydix_status arrays_of_lists(const auto* lists, std::size_t* rows, const std::uint64_t** offsets,
                              const std::uint32_t** indices, const Scalar** distances) {
    return guarded([&] {
        require(lists, "lists");
        if (rows != nullptr) *rows = lists->lists.offsets.size() - 1;
        if (offsets != nullptr) *offsets = lists->lists.offsets.data();
        if (indices != nullptr) *indices = lists->lists.indices.data();
        if (distances != nullptr) *distances = lists->lists.distances.data();
    });
}

}  // namespace raydix_c

extern "C" {

raydix_status raydix_points_create(const float* points, size_t count, int threads,
                                   raydix_points** index) {
    return raydix_c::create_points(points, count, threads, index);
}

raydix_status raydix_points_create_d(const double* points, size_t count, int threads,
                                     raydix_points_d** index) {
    return raydix_c::create_points(points, count, threads, index);
}

void raydix_points_destroy(raydix_points* index) { delete index; }

void raydix_points_destroy_d(raydix_points_d* index) { delete index; }

raydix_status raydix_points_size(const raydix_points* index, size_t* size) {
    return raydix_c::size_of_points(index, size);
}

raydix_status raydix_points_size_d(const raydix_points_d* index, size_t* size) {
    return raydix_c::size_of_points(index, size);
}

raydix_status raydix_points_knn(const raydix_points* index, const float* queries, size_t count,
                                uint32_t k, uint32_t* indices, float* distances, int threads) {
    return raydix_points_knn_within(index, queries, count, k, raydix_c::unlimited, indices,
                                    distances, threads);
}

raydix_status raydix_points_knn_within(const raydix_points* index, const float* queries,
                                       size_t count, uint32_t k, float max_distance,
                                       uint32_t* indices, float* distances, int threads) {
    return raydix_c::knn(index, queries, count, k, max_distance, indices, distances, threads);
}

raydix_status raydix_points_knn_d(const raydix_points_d* index, const double* queries, size_t count,
                                  uint32_t k, uint32_t* indices, double* distances, int threads) {
    return raydix_points_knn_within_d(index, queries, count, k, raydix_c::unlimited, indices,
                                      distances, threads);
}

raydix_status raydix_points_knn_within_d(const raydix_points_d* index, const double* queries,
                                         size_t count, uint32_t k, double max_distance,
                                         uint32_t* indices, double* distances, int threads) {
    return raydix_c::knn(index, queries, count, k, max_distance, indices, distances, threads);
}

raydix_status raydix_points_count(const raydix_points* index, const float* queries, size_t count,
                                  float radius, uint32_t* counts, int threads) {
    return raydix_c::count_points(index, queries, count, radius, counts, threads);
}

raydix_status raydix_points_count_d(const raydix_points_d* index, const double* queries,
                                    size_t count, double radius, uint32_t* counts, int threads) {
    return raydix_c::count_points(index, queries, count, radius, counts, threads);
}

raydix_status raydix_points_radius(const raydix_points* index, const float* queries, size_t count,
                                   float radius, int sorted, int threads, raydix_lists** lists) {
    return raydix_points_radius_limited(index, queries, count, radius, sorted, 0, threads, lists);
}

raydix_status raydix_points_radius_limited(const raydix_points* index, const float* queries,
                                           size_t count, float radius, int sorted,
                                           uint64_t max_result_bytes, int threads,
                                           raydix_lists** lists) {
    return raydix_c::points_within(index, queries, count, radius, sorted != 0, max_result_bytes,
                                   threads, lists);
}

raydix_status raydix_points_radius_d(const raydix_points_d* index, const double* queries,
                                     size_t count, double radius, int sorted, int threads,
                                     raydix_lists_d** lists) {
    return raydix_points_radius_limited_d(index, queries, count, radius, sorted, 0, threads, lists);
}

raydix_status raydix_points_radius_limited_d(const raydix_points_d* index, const double* queries,
                                             size_t count, double radius, int sorted,
                                             uint64_t max_result_bytes, int threads,
                                             raydix_lists_d** lists) {
    return raydix_c::points_within(index, queries, count, radius, sorted != 0, max_result_bytes,
                                   threads, lists);
}

void raydix_lists_destroy(raydix_lists* lists) { delete lists; }

void raydix_lists_destroy_d(raydix_lists_d* lists) { delete lists; }

raydix_status raydix_lists_arrays(const raydix_lists* lists, size_t* rows, const uint64_t** offsets,
                                  const uint32_t** indices, const float** distances) {
    return raydix_c::arrays_of_lists(lists, rows, offsets, indices, distances);
}

raydix_status raydix_lists_arrays_d(const raydix_lists_d* lists, size_t* rows,
                                    const uint64_t** offsets, const uint32_t** indices,
                                    const double** distances) {
    return raydix_c::arrays_of_lists(lists, rows, offsets, indices, distances);
}

}  // extern "C"
