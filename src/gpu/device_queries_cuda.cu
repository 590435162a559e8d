// raydix/device_queries.h on a CUDA device: launches on the caller's stream.
#include <raydix/device_queries.h>

#include "exec/cuda_launcher.cuh"
#include "gpu/cuda_backend.h"
#include "gpu/device_queries.h"

namespace raydix {
namespace {

/// For launches that neither scan nor sort.
CudaLauncher plain_launcher(Stream stream) {
    return {static_cast<cudaStream_t>(stream), nullptr, CudaLauncher::reserved_bytes};
}

CudaLauncher scanning_launcher(std::span<std::byte> scratch, std::uint32_t rows, Stream stream) {
    check_offsets_scratch(scratch, device_offsets_scratch_bytes(rows));
    return {static_cast<cudaStream_t>(stream), scratch.data(), scratch.size()};
}

}  // namespace

std::size_t CudaBackend::offsets_scratch_bytes(std::uint32_t n) {
    static_cast<void>(name());  // says what is missing
    CudaSizer sizer;
    sizer.exclusive_scan_wide("", nullptr, n + 1);
    return CudaLauncher::reserved_bytes + sizer.bytes();
}

void CudaBackend::knn(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
                      std::span<std::uint32_t> indices, std::span<float> distances,
                      std::uint32_t* invalid, Stream stream) {
    static_cast<void>(name());
    check_knn(tree, queries, k, indices, distances);
    CudaLauncher launcher = plain_launcher(stream);
    launch_knn(launcher, tree, queries, k, indices, distances, invalid);
}

void CudaBackend::radius_count(const DevicePoints& tree, std::span<const Vec3> queries,
                               float radius, std::span<std::uint64_t> offsets,
                               std::uint32_t* invalid, std::span<std::byte> scratch,
                               Stream stream) {
    static_cast<void>(name());
    check_radius(tree, queries, radius, offsets.size());
    CudaLauncher launcher = scanning_launcher(scratch, count_of(queries), stream);
    launch_radius_count(launcher, tree, queries, radius, offsets, invalid);
}

void CudaBackend::radius_fill(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                              std::span<const std::uint64_t> offsets, bool by_distance,
                              std::span<std::uint32_t> indices, std::span<float> distances,
                              Stream stream) {
    static_cast<void>(name());
    check_radius(tree, queries, radius, offsets.size());
    check_rows(indices.size(), distances.size());
    CudaLauncher launcher = plain_launcher(stream);
    launch_radius_fill(launcher, tree, queries, radius, offsets, by_distance, indices, distances);
}

void CudaBackend::closest_points(const DevicePrimitives& tree, std::span<const Vec3> queries,
                                 float max_distance, std::span<ClosestPoint> results,
                                 std::uint32_t* invalid, Stream stream) {
    static_cast<void>(name());
    check_closest(tree, queries, max_distance, results.size());
    CudaLauncher launcher = plain_launcher(stream);
    launch_closest(launcher, tree, queries, max_distance, results, invalid);
}

void CudaBackend::pairs_count(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                              std::span<std::byte> scratch, Stream stream) {
    static_cast<void>(name());
    check_pairs(query, offsets.size());
    CudaLauncher launcher = scanning_launcher(scratch, query.a.input_count, stream);
    launch_pairs_count(launcher, query, offsets);
}

void CudaBackend::pairs_fill(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                             std::span<PrimitivePair> pairs, Stream stream) {
    static_cast<void>(name());
    check_pairs(query, offsets.size());
    CudaLauncher launcher = plain_launcher(stream);
    launch_pairs_fill(launcher, query, offsets, pairs);
}

}  // namespace raydix
