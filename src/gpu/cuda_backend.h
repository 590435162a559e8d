// The row of CUDA in the table of backends. Its functions lie in the .cu files of this folder.
#pragma once

#include "gpu/backend.h"

namespace raydix {

class CudaBackend final : public DeviceBackend {
public:
    CudaBackend() : DeviceBackend("cuda") {}

    std::string name() override;
    void synchronize(Stream stream) override;
    void* allocate(std::size_t bytes) override;
    void free(void* memory) noexcept override;
    void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream) override;
    void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) override;
    double measure_copy(std::size_t bytes, int repeat) override;

    std::size_t scratch_bytes(std::uint32_t n, const BuildOptions& options) override;
    void build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override;
    void build(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
               Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override;
    BuildMs time(const DeviceBoxList& boxes, const BuildOptions& options, const DeviceTree& tree,
                 Scratch scratch, Stream stream) override;

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

    std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const WarpTree& tree, Stream stream) override;
    std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const DeviceTree& tree,
                                                      Stream stream) override;
    void trace_warps(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                     const DeviceTraceOptions& options, Scratch scratch, Stream stream) override;
    DeviceTraceMs time_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                             std::span<TreeHit> hits, const DeviceTraceOptions& options,
                             Scratch scratch, Stream stream) override;

    void trace_cwbvh(const CwbvhCall& call) override;
    double time_cwbvh(const CwbvhCall& call) override;

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
};

}  // namespace raydix
