#include "io/rdx_format.h"

#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>

namespace raydix::rdx {
namespace {

Checksum bytes_of(const XXH128_hash_t& hash) {
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, hash);
    Checksum checksum;
    std::copy(std::begin(canonical.digest), std::end(canonical.digest), checksum.begin());
    return checksum;
}

}  // namespace

Checksum checksum_of(std::span<const std::byte> bytes) {
    return bytes_of(XXH3_128bits(bytes.data(), bytes.size()));
}

Checksum checksum_of(std::span<const std::span<const std::byte>> pieces) {
    const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(),
                                                                                XXH3_freeState);
    if (state == nullptr) throw std::bad_alloc();
    XXH3_128bits_reset(state.get());
    for (const auto piece : pieces)
        if (!piece.empty()) XXH3_128bits_update(state.get(), piece.data(), piece.size());
    return bytes_of(XXH3_128bits_digest(state.get()));
}

Checksum header_checksum(std::span<const std::byte> header) {
    HeaderStart start;
    std::memcpy(&start, header.data(), sizeof(start));
    start.checksum = {};
    const std::array<std::span<const std::byte>, 2> pieces{std::as_bytes(std::span(&start, 1)),
                                                           header.subspan(sizeof(start))};
    return checksum_of(pieces);
}

}  // namespace raydix::rdx
