// Wide trees for the CPU: up to eight children a node. Boxes are floats or, if compact, 8 bits an
// axis. Triangles stand in blocks of four. They are made from any binary tree of triangles. Code to
// trace them is chosen at run time for the processor.
#pragma once

#include <raydix/bvh.h>
#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace raydix {

struct WideBvhOptions {
    int width = 8;         // children a node at most: 4 or 8
    bool compact = false;  // true: corners are looked up in a list of vertices. Fewer bytes where
                           // triangles share them, and somewhat slower
                           // rays (docs/performance/batches.md)
    int threads = 0;       // as in BuildOptions; the layout does not depend on it
};

struct WideBvhStats {
    int width = 0;
    bool compact = false;
    std::uint64_t nodes = 0;
    std::uint64_t leaves = 0;
    std::uint64_t references = 0;  // triangles in leaves; those without area are left out
    std::uint32_t max_depth = 0;   // edges from the root to the deepest leaf
    double children_per_node = 0;
    double sah = 0;  // 1 a node and 0.4 a triangle, by the boxes before they are quantised; 0 if
                     // the root has no area
    double widening =
        0;  // surface of all quantised child boxes / that of the exact ones; 1 without surface
    std::uint64_t node_bytes = 0, triangle_bytes = 0;  // vertices are among the latter
    std::uint64_t bytes = 0;                           // every byte a trace touches
    double ms = 0;                 // of making it: from a binary tree, or from a mesh
    double layout_ms = 0;          // the part of it after the binary tree or its clusters
    BuildMs stages{};              // of ms; `layout` is all that the stages before it leave
    std::uint64_t peak_bytes = 0;  // most bytes that making it took at once, this tree included,
                                   // above those that were held before
    std::uint64_t input_count = 0, left_out = 0;  // triangles given; invalid ones among them
};

/// Holds all that a trace reads: the binary tree and the mesh may go. The same bits for every
/// thread count and instruction set. A tree that was moved from is empty.
class WideBvh {
public:
    /// Empty: nothing is hit.
    WideBvh();
    /// Throws InputError for another width, if the tree holds boxes or points, or for more than
    /// 267,386,880 references.
    explicit WideBvh(const Bvh& bvh, const WideBvhOptions& options = {});
    ~WideBvh();
    WideBvh(WideBvh&&) noexcept;
    WideBvh& operator=(WideBvh&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] const WideBvhStats& stats() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const {
        const Arrays* const own = arrays_.get();
        return own != nullptr ? *own : nothing();
    }

private:
    friend class WideBvhBuilder;
    friend struct WideBvhInternals;
    [[nodiscard]] static const Arrays& nothing();
    std::unique_ptr<Arrays> arrays_;
};

/// Builds wide trees from meshes, again and again into the same memory. Not for use by two threads
/// at once.
class WideBvhBuilder {
public:
    WideBvhBuilder();
    ~WideBvhBuilder();
    WideBvhBuilder(WideBvhBuilder&&) noexcept;
    WideBvhBuilder& operator=(WideBvhBuilder&&) noexcept;

    /// Makes WideBvh(build_bvh(mesh, options)), bit for bit, but for one case: by apetrei with a
    /// max_leaf of 4, not compact and without reinsertion, nodes may be others. No binary tree is
    /// made in this case, nor by ploc, hploc and binned with a max_leaf of up to 4. The mesh may go
    /// afterwards. The threads of `options` count, not `wide.threads`. Throws InputError as both
    /// calls do, and if the mesh has vertices but no triangles.
    void build(const MeshView& mesh, const BuildOptions& options, WideBvh& tree,
               const WideBvhOptions& wide = {});

private:
    struct Scratch;
    std::unique_ptr<Scratch> scratch_;
};

/// As WideBvhBuilder makes it.
[[nodiscard]] WideBvh build_wide_bvh(
    const MeshView& mesh, const BuildOptions& options = build_options_for(Quality::balanced),
    const WideBvhOptions& wide = {});
[[nodiscard]] WideBvh build_wide_bvh(
    const Mesh& mesh, const BuildOptions& options = build_options_for(Quality::balanced),
    const WideBvhOptions& wide = {});

/// As best_build_options, by the SAH of the wide tree (WideBvhStats::sah).
[[nodiscard]] BuildOptions best_wide_build_options(const MeshView& mesh, Quality quality,
                                                   const BuildOptions& options = {},
                                                   const WideBvhOptions& wide = {});

/// The figures of the wide tree that a SceneD makes of the mesh, which is built for this call.
/// Throws InputError as build_bvh does.
[[nodiscard]] WideBvhStats wide_stats_of(
    const MeshViewD& mesh, const BuildOptions& options = build_options_for(Quality::balanced));

/// As trace(), trace_any() and trace_all() of a Bvh, bit for bit. rays [n] -> hits, occluded [n].
/// options.path says how rays go through the tree, and options.isa with which instructions.
/// Throws InputError: sizes that differ, an instruction set that this processor does not have.
TraceCounts trace(const WideBvh& tree, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options = {});
[[nodiscard]] std::vector<Hit> trace(const WideBvh& tree, std::span<const Ray> rays,
                                     const TraceOptions& options = {});
TraceCounts trace_any(const WideBvh& tree, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const TraceOptions& options = {});

[[nodiscard]] AllHits trace_all(const WideBvh& tree, std::span<const Ray> rays,
                                const TraceOptions& options = {});

/// The path that `automatic` takes; large batches without counters may also try packets in place of
/// streams. It is judged by a few windows of up to 64, evenly spread: packets if in most of them
/// origins and directions lie close together, streams if only origins do, else sorted.
[[nodiscard]] SimdPath choose_simd_path(const WideBvh& tree, std::span<const Ray> rays);

/// One ray, on the caller's thread, without any set-up.
[[nodiscard]] Hit closest_hit(const WideBvh& tree, const Ray& ray);
[[nodiscard]] bool any_hit(const WideBvh& tree, const Ray& ray);

/// Instruction sets that `simd` has code for and this processor can run, best first: for example
/// {"avx512", "avx2", "sse4"}.
[[nodiscard]] std::vector<std::string> simd_instruction_sets();

}  // namespace raydix
