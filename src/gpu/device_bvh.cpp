// What raydix/device.h does on the host: sizes, options, counts, and trees that come back.
#include <raydix/device.h>
#include <raydix/error.h>

#include <algorithm>

#include "base/options.h"
#include "gpu/device_build.h"
#include "gpu/device_fetch.h"
#include "tree/bvh_internals.h"
#include "tree/code_options.h"

namespace raydix {

void check_device_options(const BuildOptions& options, std::uint64_t n) {
    check_enum("builder", options.builder, Builder::sbvh);
    check_enum("fit", options.fit, Fit::atomic);
    check_threads(options.threads);
    check_code_options(options);
    if (!in_lbvh_family(options.builder) && options.builder != Builder::hploc)
        throw InputError("builder " + std::string(builder_name(options.builder)) +
                         " does not run on a device");
    if (options.reinsertion_rounds != 0)
        throw InputError("build option reinsertion_rounds is " +
                         std::to_string(options.reinsertion_rounds) +
                         "; a device builds without reinsertion, 0");
    if (n >= std::uint64_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
}

std::size_t device_node_capacity(std::uint32_t n, const BuildOptions& options) {
    check_device_options(options, n);
    return 2 * std::size_t{inner_limit(n, options)} + 2;
}

std::size_t device_pair_capacity(std::uint32_t n, const BuildOptions& options) {
    check_device_options(options, n);
    return std::max<std::size_t>(inner_limit(n, options), 1);
}

Bvh download_bvh(const DeviceTree& tree, PrimitiveKind kind, const BuildOptions& options,
                 Stream stream) {
    const DeviceCounts counts = fetch_counts(tree.counts, stream);
    check_counts(counts, kind, options.strict);
    Bvh bvh;
    const BvhInternals access{bvh};
    access.kind() = kind;
    access.options() = options;
    access.input_count() = counts.input_count;
    access.left_out() = counts.left_out;
    access.inner_count() = counts.inner_count;
    access.max_depth() = counts.max_depth;
    const std::size_t n = counts.references;
    if (n == 0) return bvh;
    fetch(access.nodes(), tree.nodes, 2 * std::size_t{counts.inner_count} + 2, stream);
    fetch(access.order(), tree.order, n, stream);
    switch (kind) {
        case PrimitiveKind::triangles:
            fetch(access.triangles(), tree.triangles, n, stream);
            break;
        case PrimitiveKind::boxes:
            fetch(access.boxes(), tree.boxes, n, stream);
            break;
        case PrimitiveKind::points:
            fetch(access.points(), tree.points, n, stream);
            break;
    }
    synchronize(stream);
    return bvh;
}

DeviceBvh::DeviceBvh(PrimitiveKind kind, std::uint32_t n, const BuildOptions& options,
                     bool with_pairs)
    : kind_(kind), capacity_(n), options_(options), scratch_(device_scratch_bytes(n, options)) {
    nodes_.reset(device_node_capacity(n, options));
    order_.reset(n);
    counts_.reset(1);
    if (kind == PrimitiveKind::triangles) triangles_.reset(n);
    if (kind == PrimitiveKind::boxes) boxes_.reset(n);
    if (kind == PrimitiveKind::points) points_.reset(n);
    if (with_pairs) {
        pairs_.reset(device_pair_capacity(n, options) * sizeof(NodePair));
        pair_ids_.reset(n);
    }
}

DeviceTree DeviceBvh::tree() const {
    return {nodes_.data(),
            order_.data(),
            triangles_.data(),
            boxes_.data(),
            points_.data(),
            counts_.data(),
            reinterpret_cast<NodePair*>(pairs_.data()),
            pair_ids_.data()};
}

void DeviceBvh::check_input(PrimitiveKind kind, std::uint32_t n) const {
    check_device_input(kind, n, kind_, capacity_);
}

void DeviceBvh::check_input(const DeviceMesh& mesh) const {
    check_input(kind_of(mesh), count_of(mesh));
}

BuildMs DeviceBvh::build_timed(const DeviceMesh& mesh, Stream stream) {
    check_input(mesh);
    return time_build_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()}, stream);
}

void DeviceBvh::build(const DeviceMesh& mesh, Stream stream) {
    check_input(mesh);
    build_bvh_on_device(mesh, options_, tree(), {scratch_.data(), scratch_.size()}, stream);
}

void DeviceBvh::build(const DeviceBoxList& boxes, Stream stream) {
    check_input(PrimitiveKind::boxes, boxes.count);
    build_bvh_on_device(boxes, options_, tree(), {scratch_.data(), scratch_.size()}, stream);
}

Bvh DeviceBvh::download(Stream stream) const {
    return download_bvh(tree(), kind_, options_, stream);
}

std::size_t DeviceBvh::bytes() const {
    return nodes_.bytes() + order_.bytes() + triangles_.bytes() + boxes_.bytes() + points_.bytes() +
           counts_.bytes() + pairs_.bytes() + pair_ids_.bytes() + scratch_.bytes();
}

}  // namespace raydix
