// src/report/picture.cpp, png.cpp, exr.cpp: files there and back, and files that lie.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <raydix/error.h>
#include <raydix/picture.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>

#include "report/srgb.h"
#include "support/support.h"

namespace raydix {
namespace {

namespace fs = std::filesystem;

Picture random_picture(std::uint32_t width, std::uint32_t height, float top) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> value(0.0f, top);
    Picture picture{width, height, {}};
    for (std::size_t i = 0; i < std::size_t{width} * height; ++i)
        picture.pixels.push_back({value(random), value(random), value(random)});
    return picture;
}

std::string bytes_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
}

std::string error_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const InputError& error) {
        return error.what();
    }
    return "no error";
}

void expect_error(const std::function<void()>& call, const fs::path& file,
                  const std::string& reason) {
    const std::string error = error_of(call);
    EXPECT_NE(error.find(file.string()), std::string::npos) << error;
    EXPECT_NE(error.find(reason), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

TEST(Png, ComesBackAsTheNearestByte) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.png";
    const Picture picture = random_picture(37, 23, 1.2f);
    save_picture(file, picture, false);
    const Picture back = load_picture(file);
    ASSERT_EQ(back.width, 37u);
    ASSERT_EQ(back.height, 23u);
    ASSERT_EQ(back.pixels.size(), picture.pixels.size());
    for (std::size_t i = 0; i < back.pixels.size(); ++i) {
        EXPECT_EQ(srgb_byte(back.pixels[i].x), srgb_byte(picture.pixels[i].x));
        EXPECT_EQ(srgb_byte(back.pixels[i].y), srgb_byte(picture.pixels[i].y));
        EXPECT_EQ(srgb_byte(back.pixels[i].z), srgb_byte(picture.pixels[i].z));
    }
}

TEST(Png, ToneMapsOnRequest) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.PNG";
    const Picture bright{2, 1, {{4.0f, 0.18f, 0.0f}, {1.0f, 1e9f, infinity}}};
    save_picture(file, bright, true);
    const Picture mapped = load_picture(file);
    EXPECT_EQ(srgb_byte(mapped.pixels[0].x), srgb_byte(film_curve(4.0f)));
    EXPECT_LT(srgb_byte(mapped.pixels[1].x), 255);
    EXPECT_EQ(srgb_byte(mapped.pixels[1].z), 255);
    save_picture(file, bright, false);
    EXPECT_EQ(srgb_byte(load_picture(file).pixels[1].x), 255);
}

TEST(Exr, KeepsEveryBit) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.exr";
    Picture picture = random_picture(19, 11, 1e6f);
    picture.pixels[3] = {-1.5f, 1e-42f, infinity};
    save_picture(file, picture, true);

    Imf::InputFile in(file.c_str());
    ASSERT_EQ(in.header().dataWindow().max.x, 18);
    ASSERT_EQ(in.header().dataWindow().max.y, 10);
    std::vector<Vec3> back(picture.pixels.size());
    Imf::FrameBuffer frame;
    const char* const names[] = {"R", "G", "B"};
    for (std::size_t k = 0; k < 3; ++k) {
        ASSERT_NE(in.header().channels().findChannel(names[k]), nullptr);
        frame.insert(names[k], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(back.data()) + 4 * k,
                                          sizeof(Vec3), sizeof(Vec3) * 19));
    }
    in.setFrameBuffer(frame);
    in.readPixels(0, 10);
    EXPECT_EQ(std::memcmp(back.data(), picture.pixels.data(), back.size() * sizeof(Vec3)), 0);
}

TEST(SavePicture, NamesTheFileAndTheReason) {
    const test::TempFolder folder;
    const Picture picture = random_picture(4, 4, 1.0f);
    const auto save = [&](const fs::path& file, const Picture& p) {
        return [&, file] { save_picture(file, p, false); };
    };
    for (const char* name : {"a.png", "a.exr"}) {
        const fs::path missing = folder.path() / "none" / name;
        expect_error(save(missing, picture), missing, "cannot write: No such file or directory");
        const fs::path taken = folder.path() / "folder" / name;
        fs::create_directories(taken);
        expect_error(save(taken, picture), taken, "cannot write: Is a directory");
        const fs::path small = folder.path() / name;
        expect_error(save(small, Picture{}), small, "0 x 0");
        expect_error(save(small, Picture{2, 2, {{0, 0, 0}}}), small, "holds 1 pixels");
        expect_error(save(small, Picture{16385, 1, {}}), small, "16385 x 1");
        EXPECT_FALSE(fs::exists(small));
    }
    expect_error(save(folder.path() / "a.jpg", picture), folder.path() / "a.jpg",
                 "known: .png .exr");
    expect_error(save(folder.path() / "a", picture), folder.path() / "a", "unknown picture type");
}

TEST(SavePicture, LeavesNothingElseBehind) {
    const test::TempFolder folder;
    save_picture(folder.path() / "a.png", random_picture(4, 4, 1.0f), false);
    save_picture(folder.path() / "a.png", random_picture(5, 4, 1.0f), false);
    fs::create_directories(folder.path() / "b.png");
    EXPECT_THROW(save_picture(folder.path() / "b.png", random_picture(4, 4, 1.0f), false),
                 InputError);
    std::size_t entries = 0;
    for (const auto& entry : fs::directory_iterator(folder.path())) {
        (void)entry;
        ++entries;
    }
    EXPECT_EQ(entries, 2u);
    EXPECT_EQ(load_picture(folder.path() / "a.png").width, 5u);
}

TEST(LoadPicture, NamesWhatIsWrong) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.png";
    const auto load = [&] { (void)load_picture(file); };
    expect_error(load, file, "no such file");
    fs::create_directories(file);
    expect_error(load, file, "not a regular file");
    fs::remove(file);
    write_bytes(file, "");
    expect_error(load, file, "PNG");
    write_bytes(file, "not a picture at all, but long enough");
    expect_error(load, file, "PNG");
}

TEST(LoadPicture, TruncatedAndAlteredFilesAreErrorsOrPictures) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.png";
    save_picture(file, random_picture(40, 30, 1.0f), false);
    const std::string good = bytes_of(file);
    for (std::size_t size = 0; size + 12 < good.size(); size += 97) {
        write_bytes(file, good.substr(0, size));
        EXPECT_THROW((void)load_picture(file), InputError) << size;
    }
    std::mt19937 random(3);
    for (int round = 0; round < 300; ++round) {
        std::string bad = good;
        for (int k = 0; k < 3; ++k) bad[random() % bad.size()] = static_cast<char>(random());
        write_bytes(file, bad);
        try {
            const Picture picture = load_picture(file);
            EXPECT_EQ(picture.pixels.size(), std::size_t{picture.width} * picture.height);
        } catch (const InputError&) {
        }
    }
}

/// The bytes of a chunk's check sum, as PNG defines it.
std::string check_sum(const std::string& bytes) {
    std::uint32_t crc = 0xFFFFFFFFu;
    for (const char c : bytes) {
        crc ^= static_cast<unsigned char>(c);
        for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
    }
    crc = ~crc;
    std::string text;
    for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(crc >> shift);
    return text;
}

TEST(LoadPicture, AHeaderThatClaimsTooMuchCostsNothing) {
    const test::TempFolder folder;
    const fs::path file = folder.path() / "a.png";
    save_picture(file, random_picture(4, 4, 1.0f), false);
    std::string bytes = bytes_of(file);
    const auto claim = [&](const std::string& size) {
        bytes.replace(16, 8, size);
        bytes.replace(29, 4, check_sum(bytes.substr(12, 17)));
        write_bytes(file, bytes);
    };
    claim(std::string("\0\0\x40\0\0\0\x40\0", 8));  // 16384 x 16384
    expect_error([&] { (void)load_picture(file); }, file, "can hold");
    claim(std::string("\0\0\x40\1\0\0\0\1", 8));  // 16385 x 1
    expect_error([&] { (void)load_picture(file); }, file, "at most 16384");
}

}  // namespace
}  // namespace raydix
