// Numbers of what a rank holds come back as they were given.
#include "mpi/global_ids.h"

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

void expect_kept(const std::vector<std::uint64_t>& ids, std::uint64_t bytes) {
    const GlobalIds kept{std::vector(ids)};
    for (std::size_t i = 0; i < ids.size(); ++i)
        ASSERT_EQ(kept.of(static_cast<std::uint32_t>(i)), ids[i]) << i;
    EXPECT_EQ(kept.bytes(), bytes);
}

TEST(GlobalIds, AreThoseThatWereGiven) {
    std::vector<std::uint64_t> near, far;
    for (std::uint64_t i = 0; i < 1000; ++i) {
        near.push_back((std::uint64_t{1} << 40) + i * i);
        far.push_back(i << 32);
    }
    expect_kept({}, 0);
    expect_kept(near, 1000 * 4 + 4 * 8);  // of 256 each one whole
    expect_kept(far, 1000 * 8);           // steps of 2^32 do not fit
    expect_kept({7, 7 + 0xFFFFFFFFull}, 2 * 4 + 8);
    EXPECT_EQ(GlobalIds(30).of(12), 42u);
}

}  // namespace
}  // namespace raydix::mpi::test
