#include "support/digests.h"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <ostream>

#include "support/support.h"

namespace raydix::test {
namespace {

static_assert(std::endian::native == std::endian::little);

struct Digits {
    std::string values, where;

    friend bool operator==(const Digits&, const Digits&) = default;
};

}  // namespace

Packed& Packed::append(const void* bytes, std::size_t size) {
    const auto* first = static_cast<const unsigned char*>(bytes);
    bytes_.insert(bytes_.end(), first, first + size);
    return *this;
}

std::string Packed::digest() const {
    if (bytes_.empty()) return "-";
    return fmt::format("{:016x}", XXH3_64bits(bytes_.data(), bytes_.size()));
}

std::string name_of(const Known& known) {
    std::string name = fmt::format("{}_{}", known.scene, known.query);
    std::replace_if(
        name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
    return name;
}

void PrintTo(const Known& known, std::ostream* out) { *out << known.scene << ", " << known.query; }

void expect_known(const Known& known, const Question& question) {
    ASSERT_FALSE(question.ways.empty());
    const std::string input = question.input.digest();
    EXPECT_EQ(input, known.input) << "the input; of rays, those that are made from hits too";
    const Digits wanted{known.values, known.where};
    std::vector<Digits> found;
    const std::size_t step = thorough > 1 ? 1 : 3;  // where everything is slow, some of the ways
    for (std::size_t i = 0; i < question.ways.size(); i += step) {
        const Way& way = question.ways[i];
        const Answer answer = way.answer();
        found.push_back({answer.values.digest(), answer.where.digest()});
        EXPECT_GE(answer.found, question.least_found) << way.name << ": too few for a test";
        EXPECT_EQ(found.back().values, wanted.values) << way.name << ", values";
        EXPECT_EQ(found.back().where, wanted.where) << way.name << ", where";
    }
    const bool agree = std::all_of(found.begin(), found.end(),
                                   [&](const Digits& digits) { return digits == found[0]; });
    if (!agree)
        ADD_FAILURE() << "the ways disagree with each other";
    else if (input != known.input || found[0] != wanted)
        ADD_FAILURE() << fmt::format(
            "all {} ways agree; the new row:\n    {{\"{}\", \"{}\", \"{}\", \"{}\", \"{}\"}},",
            found.size(), known.scene, known.query, input, found[0].values, found[0].where);
}

}  // namespace raydix::test
