// Feeds bytes to the .rdx reader. Checksums are made right first, else no input would get past
// them.
#include <raydix/error.h>

#include <cstdlib>
#include <cstring>

#include "../tests/support/rdx_seal.h"
#include "api/rdx_parse.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace raydix;
    const std::shared_ptr<void> owner = allocate_bytes(size);
    const std::span<std::byte> bytes(static_cast<std::byte*>(owner.get()), size);
    if (size != 0) std::memcpy(bytes.data(), data, size);
    if (size >= sizeof(rdx::Header)) test::seal_rdx(bytes);
    try {
        const RdxFile file = rdx::parse("fuzz.rdx", bytes, owner);
        // What was accepted must bear being walked.
        if (tree_stats(file.bvh).leaves != file.bvh.leaf_count()) std::abort();
    } catch (const InputError&) {
        return 0;
    }
    return 0;
}
