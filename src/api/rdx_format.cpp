#include "api/rdx_format.h"

#include <xxhash.h>

#include <algorithm>

namespace raydix::rdx {

Checksum checksum_of(std::span<const std::byte> bytes) {
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, XXH3_128bits(bytes.data(), bytes.size()));
    Checksum checksum;
    std::copy(std::begin(canonical.digest), std::end(canonical.digest), checksum.begin());
    return checksum;
}

Checksum checksum_of(const Header& header) {
    Header blank = header;
    blank.checksum = {};
    return checksum_of(std::as_bytes(std::span(&blank, 1)));
}

}  // namespace raydix::rdx
