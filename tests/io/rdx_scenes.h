// Scenes in .rdx files, as several tests make and read them.
#pragma once

#include <raydix/rdx_scene.h>
#include <raydix/surface.h>

#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/affine.h"
#include "io/rdx_faults.h"
#include "io/rdx_parse.h"
#include "io/rdx_scene_format.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix::test {

class Dice : public Random {
public:
    using Random::Random;
    Transform transform(float reach) {
        Transform t;
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            row[3] = between(-reach, reach);
        }
        return inverse_of(affine_of(t)) ? t : transform(reach);
    }
    std::uint32_t mask() { return below(3) == 0 ? 1u << below(3) : 0xFFFFFFFFu; }
};

inline std::vector<Ray> random_rays(Dice& dice, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = dice.in(-5, 5), to = dice.in(-1, 1.5f);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
    }
    return rays;
}

/// What the reader says to these bytes; "" if it takes them. Rays go through what it took.
inline std::string verdict(std::span<const std::byte> bytes) {
    return verdict_of(bytes, [](std::span<std::byte> copy, const std::shared_ptr<void>& owner) {
        const RdxScene file = rdx::parse_scene("x.rdx", copy, owner);
        Dice dice(1);
        const std::vector<Ray> rays = random_rays(dice, 20);
        const std::vector<Hit> hits = trace(file.scene, rays, {.threads = 1});
        std::vector<Vec3> points(hits.size());
        positions(file.scene, rays, hits, points, 1);
    });
}

inline std::vector<rdx::Section> table_of(std::span<const std::byte> bytes) {
    rdx::HeaderStart start;
    std::memcpy(&start, bytes.data(), sizeof(start));
    std::vector<rdx::Section> table(start.section_count);
    std::memcpy(table.data(), bytes.data() + sizeof(rdx::HeaderStart),
                table.size() * sizeof(rdx::Section));
    return table;
}

inline std::size_t header_bytes_of(std::span<const std::byte> bytes) {
    return sizeof(rdx::HeaderStart) + table_of(bytes).size() * sizeof(rdx::Section);
}

/// A folder with one such file.
class RdxSceneTest : public ::testing::Test {
protected:
    [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "scene.rdx"; }
    Bytes saved(const Scene& scene) {
        save_rdx(file(), scene, "a scene", cameras_);
        return read_bytes(file());
    }

    TempFolder folder_;
    const CameraSet cameras_{
        640, 480, 0.5f, {{"front \xff", {0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 30}, {}}};
};

}  // namespace raydix::test
