#include "attack/file_bytes.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "support/rdx_seal.h"

namespace raydix::attack {

Bytes ScratchFile::bytes() const {
    Bytes bytes(std::filesystem::file_size(path()));
    std::ifstream in(path(), std::ios::binary);
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

Bytes mutated(Random& random, const Bytes& sound, std::span<const Stretch> stretches) {
    Bytes bytes = sound;
    const std::uint32_t changes = 1 + random.below(3);
    constexpr std::uint32_t words[] = {
        0, 1, 2, 3, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu, 0x7F800000u, 0x7FC00000u, 0x00000100u};
    for (std::uint32_t i = 0; i < changes; ++i) {
        const Stretch& within = stretches[random.below(stretches.size())];
        const std::size_t place = within.begin + random.below(within.end - within.begin);
        switch (random.below(4)) {
            case 0:
                bytes[place] ^= static_cast<std::byte>(1u << random.below(8));
                break;
            case 1:
                bytes[place] = static_cast<std::byte>(random.below(256));
                break;
            case 2: {
                const std::size_t aligned = std::min(place & ~std::size_t{3}, bytes.size() - 4);
                std::uint32_t word = random.one_of(words);
                if (random.chance(0.3)) {
                    std::memcpy(&word, bytes.data() + aligned, 4);
                    word += random.chance(0.5) ? 1u : 0xFFFFFFFFu;
                }
                std::memcpy(bytes.data() + aligned, &word, 4);
                break;
            }
            default: {
                const std::size_t length = std::min<std::size_t>(32, bytes.size() - place);
                const std::size_t from = random.below(bytes.size() - length + 1);
                std::memmove(bytes.data() + place, bytes.data() + from, length);
            }
        }
    }
    if (random.chance(0.05)) bytes.resize(random.below(bytes.size()));
    return bytes;
}

SealedFile::SealedFile(const Bytes& bytes)
    : owner(allocate_bytes(bytes.size() + 1)),
      view(static_cast<std::byte*>(owner.get()), bytes.size()) {
    std::copy(bytes.begin(), bytes.end(), view.begin());
    if (view.size() >= sizeof(rdx::HeaderStart)) test::seal_rdx(view);
}

void expect_refusal(Case& c, const InputError& error, std::span<const std::string_view> sections) {
    const std::string message = error.what();
    const auto reproducer = [&] { return "    " + message + "\n"; };
    c.expect(message.find('\n') == std::string::npos, "files/mutated that were refused",
             "an error of several lines", reproducer);
    const std::string_view start = "attack.rdx: ";
    const std::string_view rest =
        std::string_view(message).substr(std::min(start.size(), message.size()));
    const bool named =
        message.starts_with(start) && std::ranges::any_of(sections, [&](std::string_view section) {
            return rest.starts_with(section) && rest.substr(section.size()).starts_with(": ");
        });
    c.expect(named, "files/mutated that were refused", "an error that names no section",
             reproducer);
}

}  // namespace raydix::attack
