// Makes the checksums and the length of an .rdx file right again after something in it was changed,
// so that tests and the fuzzer get to what lies behind them.
#pragma once

#include <cstring>
#include <span>

#include "api/rdx_format.h"

namespace raydix::test {

/// `file` holds a header at least. Sections that do not fit keep their checksum.
inline void seal_rdx(std::span<std::byte> file) {
    rdx::Header header;
    std::memcpy(&header, file.data(), sizeof(header));
    header.magic = rdx::magic;
    header.version = rdx::version;
    header.file_bytes = file.size();
    for (rdx::Section& section : header.sections) {
        if (section.offset > file.size() || section.element_bytes == 0) continue;
        const std::uint64_t room = file.size() - section.offset;
        if (section.count > room / section.element_bytes) continue;
        section.checksum =
            rdx::checksum_of(file.subspan(section.offset, section.count * section.element_bytes));
    }
    header.checksum = rdx::checksum_of(header);
    std::memcpy(file.data(), &header, sizeof(header));
}

}  // namespace raydix::test
