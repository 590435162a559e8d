// What trees on a device have in common on the host: the input's kind and size, what the header
// says, and arrays that come back.
#pragma once

#include <raydix/buffer.h>
#include <raydix/device.h>

#include <cstddef>
#include <cstdint>
#include <exception>

namespace raydix {

[[nodiscard]] inline PrimitiveKind kind_of(const DeviceMesh& mesh) {
    return mesh.triangle_count == 0 ? PrimitiveKind::points : PrimitiveKind::triangles;
}
[[nodiscard]] inline std::uint32_t count_of(const DeviceMesh& mesh) {
    return mesh.triangle_count == 0 ? mesh.vertex_count : mesh.triangle_count;
}

/// Throws InputError unless n primitives of `kind` fit into memory for `capacity` of `expected`.
void check_device_input(PrimitiveKind kind, std::uint32_t n, PrimitiveKind expected,
                        std::uint32_t capacity);

/// Waits for `stream`.
template <class Counts>
[[nodiscard]] Counts fetch_counts(const Counts* device, Stream stream) {
    Counts counts{};
    detail::copy_to_host(&counts, device, sizeof(counts), stream);
    synchronize(stream);
    return counts;
}

/// Complete once the stream has been waited for. If it throws, the stream has been: what was
/// fetched before may be freed.
template <class T>
void fetch(Buffer<T>& out, const T* device, std::size_t size, Stream stream) {
    try {
        out.reset(size);
        detail::copy_to_host(out.data(), device, size * sizeof(T), stream);
    } catch (...) {
        try {
            synchronize(stream);
        } catch (const std::exception&) {  // the first failure is the one to tell
        }
        throw;
    }
}

}  // namespace raydix
