// What raydix/device.h does on the host: sizes, options, counts, and trees that come back.
#include <raydix/device.h>
#include <raydix/error.h>

#include <algorithm>

#include "api/device_build.h"
#include "tree/bvh_access.h"

namespace raydix {
namespace {

const char* name_of(PrimitiveKind kind) {
    switch (kind) {
        case PrimitiveKind::triangles:
            return "triangle";
        case PrimitiveKind::boxes:
            return "box";
        default:
            return "point";
    }
}

std::uint32_t inner_limit(std::uint32_t n, int max_leaf) {
    return inner_node_limit(n, static_cast<std::uint32_t>(max_leaf));
}

template <class T>
void fetch(Buffer<T>& out, const T* device, std::size_t size, Stream stream) {
    out.reset(size);
    detail::copy_to_host(out.data(), device, size * sizeof(T), stream);
}

}  // namespace

void check_device_options(const BuildOptions& options, std::uint64_t n) {
    if (options.bits != 30 && options.bits != 63)
        throw InputError("build option bits is " + std::to_string(options.bits) +
                         "; it must be 30 or 63");
    if (options.max_leaf < 1 || options.max_leaf > 255)
        throw InputError("build option max_leaf is " + std::to_string(options.max_leaf) +
                         "; it must be 1 to 255");
    if (!in_lbvh_family(options.builder))
        throw InputError("builder " + std::string(builder_name(options.builder)) +
                         " does not run on a device");
    if (n >= std::uint64_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
}

std::size_t device_node_capacity(std::uint32_t n, int max_leaf) {
    return 2 * std::size_t{inner_limit(n, max_leaf)} + 2;
}

std::size_t device_pair_capacity(std::uint32_t n, int max_leaf) {
    return std::max<std::size_t>(inner_limit(n, max_leaf), 1);
}

void check_counts(const DeviceCounts& counts, PrimitiveKind kind, bool strict) {
    if (counts.unreadable != 0)
        throw InputError(std::string(name_of(kind)) + " " +
                         std::to_string(counts.first_unreadable) +
                         ": an index is past the last of the vertices");
    if (strict && counts.left_out != 0)
        throw InputError(std::string(name_of(kind)) + " " + std::to_string(counts.first_left_out) +
                         ": not finite, out of range or inverted, as are " +
                         std::to_string(counts.left_out - 1) + " others");
}

Bvh download_bvh(const DeviceTree& tree, PrimitiveKind kind, const BuildOptions& options,
                 Stream stream) {
    DeviceCounts counts{};
    detail::copy_to_host(&counts, tree.counts, sizeof(counts), stream);
    synchronize(stream);
    check_counts(counts, kind, options.strict);
    Bvh bvh;
    const BvhAccess access{bvh};
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
    nodes_.reset(device_node_capacity(n, options.max_leaf));
    order_.reset(n);
    counts_.reset(1);
    if (kind == PrimitiveKind::triangles) triangles_.reset(n);
    if (kind == PrimitiveKind::boxes) boxes_.reset(n);
    if (kind == PrimitiveKind::points) points_.reset(n);
    if (with_pairs) {
        pairs_.reset(device_pair_capacity(n, options.max_leaf) * sizeof(NodePair));
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
    if (kind != kind_)
        throw InputError(std::string("this memory is for a tree of another kind than a ") +
                         name_of(kind));
    if (n > capacity_)
        throw InputError(std::to_string(n) + " primitives; this memory is for " +
                         std::to_string(capacity_));
}

void DeviceBvh::check_input(const DeviceMesh& mesh) const {
    const bool points = mesh.triangle_count == 0;
    check_input(points ? PrimitiveKind::points : PrimitiveKind::triangles,
                points ? mesh.vertex_count : mesh.triangle_count);
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
