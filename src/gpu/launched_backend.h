// What the backends share that put launches on a stream: builds, other trees and queries, as the
// launches of device_build.h, device_trees.h and device_queries.h through a Machine (device_run.h).
// A backend's own files instantiate each class, with launched_builds.h, launched_trees.h and
// launched_queries.h: apart, so that a compiler of kernels has them in pieces.
#pragma once

#include "gpu/backend.h"

namespace raydix {

template <class Machine>
class LaunchedBuilds : public DeviceBackend {
public:
    LaunchedBuilds(std::string selector, const Machine& machine)
        : DeviceBackend(std::move(selector)), machine_(machine) {}
    using DeviceBackend::build;
    using DeviceBackend::scratch_bytes;
    using DeviceBackend::time;

    std::size_t scratch_bytes(std::uint32_t n, const BuildOptions& options) override;
    void build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override;
    void build(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override;

protected:
    /// For launches that neither scan nor sort.
    [[nodiscard]] auto plain_launcher(Stream stream) const {
        return machine_.launcher(stream, nullptr, Machine::reserved_bytes);
    }

    Machine machine_;
};

template <class Machine>
class LaunchedTrees : public LaunchedBuilds<Machine> {
public:
    using Scratch = DeviceBackend::Scratch;
    using LaunchedBuilds<Machine>::LaunchedBuilds;
    using LaunchedBuilds<Machine>::scratch_bytes;
    using LaunchedBuilds<Machine>::build;
    using LaunchedBuilds<Machine>::time;

    std::size_t scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                              const KdTreeOptions& options) override;
    void build(const DeviceMesh& mesh, const KdTreeOptions& options, const DeviceKdArrays& tree,
               Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceMesh& mesh, const KdTreeOptions& options, const DeviceKdArrays& tree,
                 Scratch scratch, Stream stream) override;
    std::size_t scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                              const OctreeOptions& options) override;
    void build(const DeviceMesh& mesh, const OctreeOptions& options, const DeviceOctreeArrays& tree,
               Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceMesh& mesh, const OctreeOptions& options,
                 const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) override;
};

template <class Machine>
class LaunchedQueries : public LaunchedTrees<Machine> {
public:
    using Scratch = DeviceBackend::Scratch;
    using LaunchedTrees<Machine>::LaunchedTrees;

    std::size_t offsets_scratch_bytes(std::uint32_t n) override;
    void knn(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
             std::span<std::uint32_t> indices, std::span<float> distances, std::uint32_t* invalid,
             Stream stream) override;
    void radius_count(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                      std::span<std::uint64_t> offsets, std::uint32_t* invalid, Scratch scratch,
                      Stream stream) override;
    void radius_fill(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                     std::span<const std::uint64_t> offsets, bool by_distance,
                     std::span<std::uint32_t> indices, std::span<float> distances,
                     Stream stream) override;
    void closest_points(const DevicePrimitives& tree, std::span<const Vec3> queries,
                        float max_distance, std::span<ClosestPoint> results, std::uint32_t* invalid,
                        Stream stream) override;
    void pairs_count(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                     Scratch scratch, Stream stream) override;
    void pairs_fill(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                    std::span<PrimitivePair> pairs, Stream stream) override;

    void name_hits(const DeviceMeshNames& names, std::span<const TreeHit> found,
                   std::span<Hit> hits, Stream stream) override;

private:
    [[nodiscard]] auto scanning_launcher(Scratch scratch, std::uint32_t rows, Stream stream);
};

}  // namespace raydix
