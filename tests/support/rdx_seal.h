// Makes the checksums and the length of an .rdx file right again after something in it was changed,
// so that tests and the fuzzer get to what lies behind them.
#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "io/rdx_format.h"
#include "io/rdx_scene_format.h"

namespace raydix::test {

/// `file` holds a HeaderStart at least. Any version but those of scenes becomes that of trees.
/// Sections that do not fit keep their checksum.
inline void seal_rdx(std::span<std::byte> file) {
    rdx::HeaderStart start;
    std::memcpy(&start, file.data(), sizeof(start));
    start.magic = rdx::magic;
    const bool scene = start.version >= rdx::scene_version && start.version <= rdx::double_version;
    if (!scene) start.version = rdx::version;
    start.file_bytes = file.size();
    std::memcpy(file.data(), &start, sizeof(start));
    const std::size_t count =
        scene ? rdx::scene_kinds_of(start.version).size() : std::size_t{rdx::section_count};
    const std::size_t whole = sizeof(start) + count * sizeof(rdx::Section);
    if (file.size() < whole) return;
    for (std::size_t id = 0; id < count; ++id) {
        std::byte* const place = file.data() + sizeof(start) + id * sizeof(rdx::Section);
        rdx::Section section;
        std::memcpy(&section, place, sizeof(section));
        if (section.offset > file.size() || section.element_bytes == 0) continue;
        const std::uint64_t room = file.size() - section.offset;
        if (section.count > room / section.element_bytes) continue;
        section.checksum = rdx::checksum_of(std::span<const std::byte>(
            file.subspan(section.offset, section.count * section.element_bytes)));
        std::memcpy(place, &section, sizeof(section));
    }
    start.checksum = rdx::header_checksum(file.first(whole));
    std::memcpy(file.data(), &start, sizeof(start));
}

}  // namespace raydix::test
