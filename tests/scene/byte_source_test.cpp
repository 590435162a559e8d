#include "scene/byte_source.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "samples.h"

namespace raydix::test {
namespace {

std::string drained(ByteSource& in) {
    std::string all(std::size_t{1} << 26, '\0');
    all.resize(in.read(all.data(), all.size()));
    return all;
}

TEST(ByteSource, blocks_views_and_skips) {
    std::string bytes;
    for (int i = 0; i < 200'000; ++i) bytes += raw(i);
    for (const Packing packing : {Packing::none, Packing::gzip, Packing::xz, Packing::zstd}) {
        const std::string packed = packing == Packing::none ? bytes : pack(bytes, packing);
        ByteSource in = ByteSource::from_memory(packed, "bytes", packing);
        ASSERT_TRUE(in.fill(500'000));
        EXPECT_EQ(in.buffered().substr(0, 500'000), std::string_view(bytes).substr(0, 500'000));
        in.consume(3);
        ASSERT_TRUE(in.skip(600'000));
        EXPECT_EQ(drained(in), bytes.substr(600'003));
        EXPECT_FALSE(in.fill(1));
        EXPECT_FALSE(in.skip(1));
    }
}

TEST(ByteSource, several_members) {
    for (const Packing packing : {Packing::gzip, Packing::xz, Packing::zstd}) {
        const std::string packed = pack("first ", packing) + pack("second", packing);
        ByteSource in = ByteSource::from_memory(packed, "bytes", packing);
        EXPECT_EQ(drained(in), "first second") << int(packing);
    }
}

TEST(ByteSource, damage_is_found) {
    std::string bytes;
    for (unsigned i = 0; i < 25'000; ++i) bytes += raw(i * 2654435761u);
    for (const Packing packing : {Packing::gzip, Packing::xz, Packing::zstd}) {
        std::string packed = pack(bytes, packing);
        packed[packed.size() / 2] = static_cast<char>(packed[packed.size() / 2] ^ 0x55);
        ByteSource in = ByteSource::from_memory(packed, "bytes", packing);
        if (packing != Packing::zstd) {  // zstd files may have no sum
            EXPECT_THROW(drained(in), InputError);
        }
        ByteSource other = ByteSource::from_memory("no such magic", "bytes", packing);
        EXPECT_THROW(drained(other), InputError);
    }
}

TEST(ByteSource, packing_by_extension) {
    EXPECT_EQ(packing_of("a.ply"), Packing::none);
    EXPECT_EQ(packing_of("a.ply.GZ"), Packing::gzip);
    EXPECT_EQ(packing_of("a.xz"), Packing::xz);
    EXPECT_EQ(packing_of("a.obj.zst"), Packing::zstd);
}

std::size_t peak_kib() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<std::size_t>(usage.ru_maxrss);
}

/// 300 MiB of one text in a few KiB.
std::string bomb(const std::string& head, const std::string& repeated, Packing packing) {
    std::string text = head;
    while (text.size() < (std::size_t{300} << 20)) text += repeated;
    return pack(text, packing);
}

TEST(ByteSource, bombs_stop) {
    // Points without a header: unpacking stops at 1000 times the packed size.
    const std::string points = bomb("", "0 0 0\n", Packing::xz);
    const std::string header =
        "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n";
    const std::string cloud = bomb(header, std::string(1 << 20, '\0'), Packing::xz);
    const std::size_t before = peak_kib();
    EXPECT_EQ(error_of(load_xyz, points, Packing::xz),
              "sample: packed data: unpacks to more than 1000 times its size");
    // With a header: not a block more than it implies.
    EXPECT_EQ(load(load_ply, cloud, Packing::xz).vertices.size(), 2u);
    EXPECT_LT(peak_kib() - before, std::size_t{400} << 10);
}

}  // namespace
}  // namespace raydix::test
