// EXR through OpenEXR, into memory: what reaches the disk is written and checked in one place.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>

#include <algorithm>
#include <cstring>

#include "report/picture_codec.h"

namespace raydix {
namespace {

/// A stream that OpenEXR writes to, seeks in and overwrites.
class MemoryStream : public Imf::OStream {
public:
    MemoryStream() : Imf::OStream("memory") {}

    void write(const char* data, int count) override {
        const auto size = static_cast<std::size_t>(count);
        if (bytes.size() < place_ + size) bytes.resize(place_ + size);
        std::memcpy(bytes.data() + place_, data, size);
        place_ += size;
    }
    std::uint64_t tellp() override { return place_; }
    void seekp(std::uint64_t place) override { place_ = place; }

    std::vector<std::byte> bytes;

private:
    std::size_t place_ = 0;
};

}  // namespace

std::vector<std::byte> encode_exr(const Picture& picture) {
    static_assert(sizeof(Vec3) == 3 * sizeof(float));
    Imf::Header header(static_cast<int>(picture.width), static_cast<int>(picture.height));
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer frame;
    // The interface asks for writable memory also where it only reads.
    auto* base = reinterpret_cast<char*>(const_cast<Vec3*>(picture.pixels.data()));
    const char* const names[] = {"R", "G", "B"};
    for (std::size_t k = 0; k < 3; ++k) {
        header.channels().insert(names[k], Imf::Channel(Imf::FLOAT));
        frame.insert(names[k], Imf::Slice(Imf::FLOAT, base + k * sizeof(float), sizeof(Vec3),
                                          sizeof(Vec3) * picture.width));
    }
    MemoryStream stream;
    {
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(frame);
        file.writePixels(static_cast<int>(picture.height));
    }  // the line table is written here
    return std::move(stream.bytes);
}

}  // namespace raydix
