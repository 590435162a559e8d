// .rdx files that were cut, altered or made up: what readers of trees and of scenes are asked
// alike.
#pragma once

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/rdx_format.h"
#include "support/random.h"
#include "support/rdx_seal.h"

namespace raydix::test {

using Bytes = std::vector<std::byte>;

inline Bytes read_bytes(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    Bytes bytes(std::filesystem::file_size(file));
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

/// What read(bytes in memory, their owner) throws; "" if it takes them.
template <class Read>
std::string verdict_of(std::span<const std::byte> bytes, const Read& read) {
    const std::shared_ptr<void> owner = allocate_bytes(bytes.size());
    const std::span<std::byte> copy(static_cast<std::byte*>(owner.get()), bytes.size());
    if (!bytes.empty()) std::memcpy(copy.data(), bytes.data(), bytes.size());
    try {
        read(copy, owner);
        return "";
    } catch (const InputError& error) {
        return error.what();
    }
}

/// At the ends of the header and of each section, and beside them. verdict(bytes): of a reader.
template <class Verdict>
void expect_cuts_refused(const Bytes& whole, std::size_t header_bytes, std::size_t sealed_bytes,
                         std::span<const rdx::Section> sections, const Verdict& verdict) {
    ASSERT_EQ(verdict(whole), "");
    std::vector<std::size_t> cuts{0, 1, 8, 63, header_bytes - 1, header_bytes, whole.size() - 1};
    for (const rdx::Section& s : sections) {
        const std::size_t end = s.offset + s.count * s.element_bytes;
        for (const std::size_t cut : {s.offset - 1, s.offset, s.offset + 1, end - 1, end})
            cuts.push_back(cut);
    }
    for (const std::size_t cut : cuts) {
        if (cut >= whole.size()) continue;
        const std::span<const std::byte> part(whole.data(), cut);
        EXPECT_NE(verdict(part).find("header: "), std::string::npos) << cut;
        if (cut < sealed_bytes) continue;
        Bytes lying(part.begin(), part.end());  // the same with a length and checksums that fit
        seal_rdx(lying);
        EXPECT_NE(verdict(lying), "") << cut;
    }
}

template <class Verdict>
void expect_every_byte_guarded(const Bytes& whole, const Verdict& verdict) {
    Random random(5);
    for (std::size_t i = 0; i < whole.size(); ++i) {
        Bytes altered = whole;
        altered[i] ^= std::byte{static_cast<unsigned char>(1 + random.below(255))};
        EXPECT_NE(verdict(altered), "") << "byte " << i;
    }
}

/// How many of `rounds` files are refused, each with up to three other bytes under right checksums.
template <class Verdict>
std::size_t refused_after_flips(const Bytes& whole, std::size_t rounds, const Verdict& verdict) {
    Random random(6);
    std::size_t refused = 0;
    for (std::size_t round = 0; round < rounds; ++round) {
        Bytes altered = whole;
        const std::size_t flips = 1 + random.below(3);
        for (std::size_t k = 0; k < flips; ++k)
            altered[random.below(altered.size())] =
                std::byte{static_cast<unsigned char>(random.below(256))};
        seal_rdx(altered);
        refused += verdict(altered).empty() ? 0 : 1;
    }
    return refused;
}

/// Liar: a file that may be changed, whose told() is the verdict on it under right checksums.
template <class Liar>
struct LieOf {
    const char* told;  // how that begins
    std::function<void(Liar&)> change;
};

template <class Liar>
void expect_told(const Bytes& whole, const std::vector<LieOf<Liar>>& lies) {
    for (const auto& lie : lies) {
        Liar liar(whole);
        ASSERT_EQ(liar.told(), "");
        lie.change(liar);
        const std::string told = liar.told();
        EXPECT_TRUE(told.starts_with(lie.told)) << "expected " << lie.told << "\n     got " << told;
        EXPECT_EQ(told.find('\n'), std::string::npos);
    }
}

}  // namespace raydix::test
