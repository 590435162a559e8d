// cameras.json -> CameraSet.
#include <fmt/format.h>

#include <cmath>

#include "base/float_env.h"
#include "base/math.h"
#include "scene/formats.h"
#include "scene/json_input.h"

namespace raydix {

using nlohmann::json;

namespace {

constexpr std::uint64_t largest_file = std::uint64_t{16} << 20;
constexpr std::uint64_t largest_side = 16384;  // pixels, as of pictures

class CameraReader {
public:
    CameraReader(const ByteSource& in, const json& object, std::string element)
        : in_(in), object_(object), element_(std::move(element)) {}

    Camera read() {
        if (!object_.is_object()) in_.fail(element_, "not an object");
        Camera camera;
        if (const auto name = object_.find("name"); name != object_.end()) {
            if (!name->is_string()) fail("name", "not a string");
            camera.name = name->get<std::string>();
        }
        camera.position = read_vector("position", nullptr);
        camera.target = read_vector("target", nullptr);
        camera.up = read_vector("up", &camera.up);
        if (object_.contains("vfov")) camera.vfov = read_number(object_["vfov"], "vfov");
        if (!(camera.vfov > 0.0f && camera.vfov < 180.0f))
            fail("vfov", "not between 0 and 180 degrees");
        check_view(camera);
        return camera;
    }

private:
    void check_view(const Camera& camera) const {
        const auto length = [](Vec3 v) {
            return std::hypot(double(v.x), double(v.y), double(v.z));
        };
        const Vec3 view = camera.target - camera.position;
        if (!in_range(camera.position)) fail("position", "beyond 1e12");
        if (!in_range(camera.target)) fail("target", "beyond 1e12");
        if (length(view) == 0.0) fail("target", "equal to position");
        const Vec3 v = view * static_cast<float>(1.0 / length(view));
        if (length(camera.up) == 0.0) fail("up", "of length 0");
        const Vec3 u = camera.up * static_cast<float>(1.0 / length(camera.up));
        if (!(length(cross(v, u)) > 1e-6)) fail("up", "parallel to the view");
    }

    Vec3 read_vector(const char* key, const Vec3* fallback) const {
        const auto found = object_.find(key);
        if (found == object_.end()) {
            if (!fallback) fail(key, "missing");
            return *fallback;
        }
        if (!found->is_array() || found->size() != 3) fail(key, "not a list of three numbers");
        const json& list = *found;
        return without_negative_zero(
            Vec3{read_number(list[0], key), read_number(list[1], key), read_number(list[2], key)});
    }

    float read_number(const json& value, const char* key) const {
        if (!value.is_number()) fail(key, "not a number");
        const auto number = static_cast<float>(value.get<double>());
        if (!std::isfinite(number)) fail(key, "not finite in single precision");
        return number;
    }

    [[noreturn]] void fail(const char* key, std::string_view reason) const {
        in_.fail(element_, fmt::format("{} is {}", key, reason));
    }

    const ByteSource& in_;
    const json& object_;
    std::string element_;
};

void read_settings(const ByteSource& in, const json& document, CameraSet& set) {
    const auto read_side = [&](const char* key, std::uint32_t& side) {
        const std::uint64_t value = find_whole(in, document, key, "picture").value_or(side);
        if (value < 1 || value > largest_side)
            in.fail("picture", fmt::format("{} is not from 1 to {}", key, largest_side));
        side = static_cast<std::uint32_t>(value);
    };
    read_side("width", set.width);
    read_side("height", set.height);
    const auto radius = document.find("ao_radius");
    if (radius == document.end()) return;
    const double value = radius->is_number() ? radius->get<double>() : -1.0;
    if (!(value >= 0.0 && value <= double(max_coordinate)))
        in.fail("ao_radius", "not a number from 0 to 1e12");
    set.ao_radius = static_cast<float>(value);
}

}  // namespace

CameraSet read_cameras(ByteSource& in) {
    const std::string text = read_rest(in, largest_file);
    const json document = parse_json(in, text);
    CameraSet set;
    if (document.is_object()) read_settings(in, document, set);
    const auto found = document.is_object() ? document.find("cameras") : document.end();
    const json& list = found == document.end() ? document : *found;
    if (!list.is_array()) in.fail("cameras", "neither a list nor an object with a list of them");
    for (const json& object : list) {
        const std::string element = fmt::format("camera {}", set.cameras.size() + 1);
        set.cameras.push_back(CameraReader(in, object, element).read());
        Camera& camera = set.cameras.back();
        if (camera.name.empty()) camera.name = fmt::format("view{}", set.cameras.size() - 1);
    }
    if (set.cameras.empty()) in.fail("cameras", "the list is empty");
    return set;
}

CameraSet load_cameras(const std::filesystem::path& file) {
    const FloatEnvironment exact;
    ByteSource in = ByteSource::from_file(file, packing_of(file));
    return read_cameras(in);
}

}  // namespace raydix
