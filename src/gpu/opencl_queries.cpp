// Queries of device_queries.h and names of hits on an OpenCL queue.
#if defined(RAYDIX_HAVE_OPENCL)

#include "gpu/device_queries.h"
#include "gpu/opencl_backend.h"

namespace raydix {
std::size_t OpenclBackend::offsets_scratch_bytes(std::uint32_t n) {
    OpenclSizer sizer;
    sizer.exclusive_scan_wide("", nullptr, n + 1);
    return OpenclMachine::reserved_bytes + sizer.bytes();
}

void OpenclBackend::knn(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
                        std::span<std::uint32_t> indices, std::span<float> distances,
                        std::uint32_t* invalid, Stream stream) {
    check_knn(tree, queries, k, indices, distances);
    OpenclLauncher launcher = plain_launcher(stream);
    launch_knn(launcher, tree, queries, k, indices, distances, invalid);
}

void OpenclBackend::radius_count(const DevicePoints& tree, std::span<const Vec3> queries,
                                 float radius, std::span<std::uint64_t> offsets,
                                 std::uint32_t* invalid, std::span<std::byte> scratch,
                                 Stream stream) {
    check_radius(tree, queries, radius, offsets.size());
    check_offsets_scratch(scratch, offsets_scratch_bytes(count_of(queries)));
    OpenclLauncher launcher = machine_.launcher(stream, scratch.data(), scratch.size());
    launch_radius_count(launcher, tree, queries, radius, offsets, invalid);
}

void OpenclBackend::radius_fill(const DevicePoints& tree, std::span<const Vec3> queries,
                                float radius, std::span<const std::uint64_t> offsets,
                                bool by_distance, std::span<std::uint32_t> indices,
                                std::span<float> distances, Stream stream) {
    check_radius(tree, queries, radius, offsets.size());
    check_rows(indices.size(), distances.size());
    OpenclLauncher launcher = plain_launcher(stream);
    launch_radius_fill(launcher, tree, queries, radius, offsets, by_distance, indices, distances);
}

void OpenclBackend::closest_points(const DevicePrimitives& tree, std::span<const Vec3> queries,
                                   float max_distance, std::span<ClosestPoint> results,
                                   std::uint32_t* invalid, Stream stream) {
    check_closest(tree, queries, max_distance, results.size());
    OpenclLauncher launcher = plain_launcher(stream);
    launch_closest(launcher, tree, queries, max_distance, results, invalid);
}

void OpenclBackend::pairs_count(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                                std::span<std::byte> scratch, Stream stream) {
    check_pairs(query, offsets.size());
    check_offsets_scratch(scratch, offsets_scratch_bytes(query.a.input_count));
    OpenclLauncher launcher = machine_.launcher(stream, scratch.data(), scratch.size());
    launch_pairs_count(launcher, query, offsets);
}

void OpenclBackend::pairs_fill(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                               std::span<PrimitivePair> pairs, Stream stream) {
    check_pairs(query, offsets.size());
    OpenclLauncher launcher = plain_launcher(stream);
    launch_pairs_fill(launcher, query, offsets, pairs);
}

void OpenclBackend::name_hits(const DeviceMeshNames& names, std::span<const TreeHit> found,
                              std::span<Hit> hits, Stream stream) {
    check_name_hits(found.size(), hits.size());
    if (found.size() >= 0x80000000u) throw InputError("2^31 hits or more in one launch");
    OpenclLauncher launcher = plain_launcher(stream);
    launcher.launch(
        "scene.name", static_cast<std::uint32_t>(found.size()),
        NameHit{{names.first(), names.ids(), names.count()}, found.data(), hits.data()});
}

}  // namespace raydix

#endif
