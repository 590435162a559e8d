#include <gtest/gtest.h>
#include <raydix/error.h>

#include <fstream>

#include "base/math.h"
#include "scene/formats.h"
#include "support/support.h"

namespace raydix::test {
namespace {

CameraSet read(std::string_view text) {
    ByteSource in = ByteSource::from_memory(text, "cameras.json");
    return read_cameras(in);
}

std::string error(std::string_view text) {
    try {
        static_cast<void>(read(text));
    } catch (const InputError& error) {
        return error.what();
    }
    return {};
}

TEST(Cameras, object_with_all_fields) {
    const CameraSet set = read(R"({"note":"x","width":640,"height":480,"ao_radius":0.5,"cameras":[
        {"name":"a","position":[1,2,3],"target":[0,-0.0,0],"up":[0,0,1],"vfov":60}]})");
    EXPECT_EQ(set.width, 640u);
    EXPECT_EQ(set.height, 480u);
    EXPECT_EQ(set.ao_radius, 0.5f);
    ASSERT_EQ(set.cameras.size(), 1u);
    EXPECT_EQ(set.cameras[0].name, "a");
    EXPECT_TRUE(set.cameras[0].position == (Vec3{1, 2, 3}));
    EXPECT_TRUE(set.cameras[0].up == (Vec3{0, 0, 1}));
    EXPECT_EQ(set.cameras[0].vfov, 60.0f);
}

TEST(Cameras, bare_list_with_defaults) {
    const CameraSet set =
        read(R"([{"position":[0,0,1],"target":[0,0,0]},{"position":[0,0,2],"target":[0,0,0]}])");
    EXPECT_EQ(set.width, 1024u);
    EXPECT_EQ(set.ao_radius, 0.0f);
    ASSERT_EQ(set.cameras.size(), 2u);
    EXPECT_EQ(set.cameras[1].name, "view1");
    EXPECT_EQ(set.cameras[1].vfov, 45.0f);
}

TEST(Cameras, says_what_is_wrong) {
    const auto camera = [](const std::string& fields) {
        return error(R"([{"position":[0,0,1],"target":[0,0,0]},{)" + fields + "}]");
    };
    EXPECT_EQ(camera(R"("target":[0,0,0])"), "cameras.json: camera 2: position is missing");
    EXPECT_EQ(camera(R"("position":[0,0],"target":[0,0,0])"),
              "cameras.json: camera 2: position is not a list of three numbers");
    EXPECT_EQ(camera(R"("position":[0,0,"1"],"target":[0,0,0])"),
              "cameras.json: camera 2: position is not a number");
    EXPECT_EQ(camera(R"("position":[0,0,1e39],"target":[0,0,0])"),
              "cameras.json: camera 2: position is not finite in single precision");
    EXPECT_EQ(camera(R"("position":[0,0,0],"target":[0,0,0])"),
              "cameras.json: camera 2: target is equal to position");
    EXPECT_EQ(camera(R"("position":[0,1,0],"target":[0,0,0])"),
              "cameras.json: camera 2: up is parallel to the view");
    EXPECT_EQ(camera(R"("position":[0,0,1],"target":[0,0,0],"vfov":180)"),
              "cameras.json: camera 2: vfov is not between 0 and 180 degrees");
    EXPECT_EQ(camera(R"("position":[0,0,1],"target":[0,0,0],"name":1)"),
              "cameras.json: camera 2: name is not a string");
    EXPECT_EQ(error("[1]"), "cameras.json: camera 1: not an object");
    EXPECT_EQ(error("[]"), "cameras.json: cameras: the list is empty");
    EXPECT_EQ(error("{}"),
              "cameras.json: cameras: neither a list nor an object with a list of them");
    EXPECT_EQ(error("[{]"), "cameras.json: JSON: not valid at byte 3");
    EXPECT_EQ(error("[1e999]"), "cameras.json: JSON: a number is out of range");
    EXPECT_EQ(error(R"({"width":0,"cameras":[]})"),
              "cameras.json: picture: width is not from 1 to 16384");
    EXPECT_EQ(error(R"({"ao_radius":-1,"cameras":[]})"),
              "cameras.json: ao_radius: not a number from 0 to 1e12");
}

TEST(Cameras, of_the_shared_scenes) {
    const auto root = shared_scene("");
    RAYDIX_SKIP_WITHOUT(root);
    int found = 0;
    for (const auto& entry : std::filesystem::directory_iterator(root)) {
        const auto file = entry.path() / "cameras.json";
        if (!std::filesystem::exists(file)) continue;
        EXPECT_EQ(load_cameras(file).cameras.size(), 5u) << file;
        ++found;
    }
    EXPECT_GT(found, 0);
}

}  // namespace
}  // namespace raydix::test
