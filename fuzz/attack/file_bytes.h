// Files for the kind `files`: a scratch file, and what random changes make of its bytes.
#pragma once

#include <raydix/error.h>

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "attack/attack.h"
#include "support/temp_path.h"

namespace raydix::attack {

using Bytes = std::vector<std::byte>;

/// A .rdx file to save to.
class ScratchFile : public test::TempPath {
public:
    ScratchFile() : TempPath("raydix_attack_", ".rdx") {}
    [[nodiscard]] Bytes bytes() const;
};

/// Bytes [begin, end) of a file, not empty.
struct Stretch {
    std::size_t begin, end;
};

/// Changes a few bytes or words, or copies a piece elsewhere; sometimes cuts the end off. Each
/// change picks one of the stretches first, so that short ones get as many as long ones.
Bytes mutated(Random& random, const Bytes& sound, std::span<const Stretch> stretches);

/// A file in memory where readers want it, with checksums that are right.
struct SealedFile {
    explicit SealedFile(const Bytes& bytes);
    std::shared_ptr<void> owner;
    std::span<std::byte> view;
};

/// "FILE: SECTION: reason", in one line.
void expect_refusal(Case& c, const InputError& error, std::span<const std::string_view> sections);

/// One saved scene and many changes of it (scene_files.cpp).
void attack_scene_file(Case& c);

}  // namespace raydix::attack
