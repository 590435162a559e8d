// Points of the C interface.
#include <limits>

#include "inside.h"

using raydix_c::array_of;
using raydix_c::guarded;
using raydix_c::require;
using raydix_c::results_at;

namespace {

std::size_t times(std::size_t count, std::size_t k) {
    if (k != 0 && count > std::numeric_limits<std::size_t>::max() / k)
        throw raydix::InputError("count * k is more than an array can have");
    return count * k;
}

}  // namespace

extern "C" {

raydix_status raydix_points_create(const float* points, size_t count, int threads,
                                   raydix_points** index) {
    return guarded([&] {
        require(index, "index");
        raydix::PointsOptions options;
        options.threads = threads;
        *index = new raydix_points{
            raydix::build_points(array_of<raydix::Vec3>(points, count, "points"), options)};
    });
}

void raydix_points_destroy(raydix_points* index) { delete index; }

raydix_status raydix_points_size(const raydix_points* index, size_t* size) {
    return guarded([&] {
        require(index, "index");
        require(size, "size");
        *size = index->index.size();
    });
}

raydix_status raydix_points_knn(const raydix_points* index, const float* queries, size_t count,
                                uint32_t k, uint32_t* indices, float* distances, int threads) {
    return guarded([&] {
        require(index, "index");
        const std::size_t size = times(count, k);
        const auto asked = array_of<raydix::Vec3>(queries, count, "queries");
        const auto ids = results_at<std::uint32_t>(indices, size, "indices");
        const auto far = results_at<float>(distances, size, "distances");
        raydix::PointQueryOptions options;
        options.threads = threads;
        raydix::knn(index->index, asked, k, ids, far, options);
    });
}

raydix_status raydix_points_count(const raydix_points* index, const float* queries, size_t count,
                                  float radius, uint32_t* counts, int threads) {
    return guarded([&] {
        require(index, "index");
        raydix::PointQueryOptions options;
        options.threads = threads;
        raydix::radius_count(index->index, array_of<raydix::Vec3>(queries, count, "queries"),
                             radius, results_at<std::uint32_t>(counts, count, "counts"), options);
    });
}

raydix_status raydix_points_radius(const raydix_points* index, const float* queries, size_t count,
                                   float radius, int sorted, int threads, raydix_lists** lists) {
    return guarded([&] {
        require(index, "index");
        require(lists, "lists");
        raydix::PointQueryOptions options;
        options.threads = threads;
        options.sort = sorted != 0;
        const auto asked = array_of<raydix::Vec3>(queries, count, "queries");
        *lists = new raydix_lists{raydix::radius_search(index->index, asked, radius, options)};
    });
}

void raydix_lists_destroy(raydix_lists* lists) { delete lists; }

raydix_status raydix_lists_arrays(const raydix_lists* lists, size_t* rows, const uint64_t** offsets,
                                  const uint32_t** indices, const float** distances) {
    return guarded([&] {
        require(lists, "lists");
        if (rows != nullptr) *rows = lists->lists.offsets.size() - 1;
        if (offsets != nullptr) *offsets = lists->lists.offsets.data();
        if (indices != nullptr) *indices = lists->lists.indices.data();
        if (distances != nullptr) *distances = lists->lists.distances.data();
    });
}

}  // extern "C"
