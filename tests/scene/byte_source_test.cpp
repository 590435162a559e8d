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

/// `head` and then 300 MiB of `repeated`, packed piece by piece.
std::string bomb(const std::string& head, const std::string& repeated) {
    namespace io = boost::iostreams;
    std::string packed;
    io::filtering_ostream out;
    out.push(io::lzma_compressor());
    out.push(io::back_inserter(packed));
    out << head;
    for (std::size_t n = 0; n < (std::size_t{300} << 20); n += repeated.size()) out << repeated;
    out.reset();
    return packed;
}

std::string block_of(const std::string& text) {
    std::string block;
    while (block.size() < 60'000) block += text;
    return block;
}

// The peak counts for the whole process, so the cases that must stay small come first.
TEST(ByteSource, bombs_and_false_counts_cost_nothing) {
#if defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the thread sanitizer's shadow would count as memory of the reader";
#endif
    const auto header = [](const std::string& count) {
        return "ply\nformat binary_little_endian 1.0\nelement vertex " + count +
               "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    };
    const std::string cloud = bomb(header("2"), std::string(60'000, '\0'));
    const std::string points = bomb("", block_of("0 0 0\n"));
    ASSERT_LT(points.size(), std::size_t{1} << 20);
    const std::size_t before = peak_kib();
    EXPECT_EQ(load(load_ply, cloud, Packing::xz).vertices.size(), 2u);
    EXPECT_NE(error_of(load_ply, header("353535235358") + "12345678"), "");
    EXPECT_NE(error_of(load_off, "OFF\n353535235358 353535235358 0\n0 0 0\n"), "");
    EXPECT_NE(error_of(load_stl, binary_stl(0xFFFFFFFF)), "");
    EXPECT_NE(error_of(load_npy_points, npy("<f8", "True", "(353535235358, 3)", "12345678")), "");
    EXPECT_LT(peak_kib() - before, std::size_t{64} << 10);
    // Points have no header: unpacking stops at 64 MiB plus 1000 times the packed size.
    EXPECT_EQ(error_of(load_xyz, points, Packing::xz),
              "sample: packed data: unpacks to more than 1000 times its size");
    EXPECT_LT(peak_kib() - before, std::size_t{1000} << 10);
}

}  // namespace
}  // namespace raydix::test
