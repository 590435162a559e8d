// Where the bytes of a saved file go, and what is left when they do not get there.
#include "base/write_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <raydix/arrays.h>
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/picture.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "support/message.h"
#include "support/resource_limit.h"
#include "support/support.h"

namespace raydix {
namespace {

namespace fs = std::filesystem;
using test::message_of;

void write(const fs::path& file, std::string_view text) {
    write_file(file, std::as_bytes(std::span(text)));
}

std::string content(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

std::size_t entries(const fs::path& folder) {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

class WriteFile : public ::testing::Test {
protected:
    test::TempFolder folder_;
    const fs::path& here_ = folder_.path();
};

TEST_F(WriteFile, ReplacesAFileAndKeepsItsPermissions) {
    const fs::path file = here_ / "a.txt";
    write(file, "first");
    EXPECT_EQ(content(file), "first");
    fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
    write(file, "second one");
    EXPECT_EQ(content(file), "second one");
    EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
    write(file, "");
    EXPECT_EQ(content(file), "");
    write(here_ / std::string(255, 'n'), "long name");
    EXPECT_EQ(content(here_ / std::string(255, 'n')), "long name");
    EXPECT_EQ(entries(here_), 2u);
}

TEST_F(WriteFile, FollowsSymbolicLinks) {
    fs::create_directory(here_ / "data");
    write(here_ / "data" / "file", "old");
    fs::create_symlink("data/file", here_ / "link");
    fs::create_symlink(here_ / "link", here_ / "second");
    write(here_ / "second", "new");
    EXPECT_TRUE(fs::is_symlink(here_ / "second"));
    EXPECT_TRUE(fs::is_symlink(here_ / "link"));
    EXPECT_FALSE(fs::is_symlink(here_ / "data" / "file"));
    EXPECT_EQ(content(here_ / "data" / "file"), "new");

    fs::create_symlink("data/made", here_ / "dangling");
    write(here_ / "dangling", "made");
    EXPECT_TRUE(fs::is_symlink(here_ / "dangling"));
    EXPECT_EQ(content(here_ / "data" / "made"), "made");
    EXPECT_EQ(entries(here_ / "data"), 2u);

    fs::create_symlink("b", here_ / "a");
    fs::create_symlink("a", here_ / "b");
    EXPECT_EQ(message_of([&] { write(here_ / "a", "x"); }),
              (here_ / "a").string() + ": cannot write: " + std::strerror(ELOOP));
}

TEST_F(WriteFile, EverySaverFollowsAndWritesThrough) {
    const std::vector<float> values{1, 2, 3};
    fs::create_symlink("array.npy", here_ / "link.npy");
    save_array(here_ / "link.npy", values, 3);
    EXPECT_TRUE(fs::is_symlink(here_ / "link.npy"));
    EXPECT_FALSE(fs::is_symlink(here_ / "array.npy"));
    EXPECT_EQ(load_array(here_ / "array.npy", 3), values);
    for (const char* name : {"p.png", "p.exr"}) {
        fs::create_symlink(std::string("real ") + name, here_ / name);
        save_picture(here_ / name, Picture{1, 1, {{0, 0, 0}}}, false);
        EXPECT_TRUE(fs::is_symlink(here_ / name));
        EXPECT_TRUE(fs::is_regular_file(here_ / (std::string("real ") + name)));
    }
}

TEST_F(WriteFile, WritesIntoAPipe) {
    const fs::path pipe = here_ / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    fs::create_symlink("pipe", here_ / "link");
    const std::string sent(300000, 'x');  // more than a pipe holds
    for (const char* name : {"pipe", "link"}) {
        std::string received;
        std::thread reader([&] { received = content(pipe); });
        write(here_ / name, sent);
        reader.join();
        EXPECT_EQ(received, sent);
    }
    EXPECT_TRUE(fs::is_fifo(pipe));
    EXPECT_EQ(entries(here_), 2u);
}

TEST_F(WriteFile, ADeviceStaysADevice) {
    // Numbers 1, 3 and 1, 7 of Linux: /dev/null and /dev/full, as files that may be lost.
    const fs::path null = here_ / "null", full = here_ / "full";
    if (mknod(null.c_str(), S_IFCHR | 0666, makedev(1, 3)) != 0 ||
        mknod(full.c_str(), S_IFCHR | 0666, makedev(1, 7)) != 0 || access(full.c_str(), W_OK) != 0)
        GTEST_SKIP() << "this user may not make devices";
    const int opened = open(null.c_str(), O_WRONLY | O_CLOEXEC);
    if (opened < 0) GTEST_SKIP() << "devices of this folder cannot be opened";
    close(opened);
    write(null, "gone");
    EXPECT_TRUE(fs::is_character_file(null));
    EXPECT_EQ(message_of([&] { write(full, "too much"); }),
              full.string() + ": cannot write: " + std::strerror(ENOSPC));
    EXPECT_TRUE(fs::is_character_file(full));
    EXPECT_EQ(entries(here_), 2u);
}

TEST_F(WriteFile, OpenDescriptorsGoOnWhereTheyStand) {
    if (!fs::exists("/proc/self/fd")) GTEST_SKIP() << "there is no /proc/self/fd";
    const fs::path file = here_ / "log";
    const int out = open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    ASSERT_GE(out, 0);
    ASSERT_EQ(::write(out, "one ", 4), 4);
    fs::create_symlink("/proc/self/fd/" + std::to_string(out), here_ / "stdout");
    write("/proc/self/fd/" + std::to_string(out), "two ");
    write(here_ / "stdout", "three ");  // as /dev/stdout is one
    ASSERT_EQ(::write(out, "four", 4), 4);
    close(out);
    EXPECT_EQ(content(file), "one two three four");

    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    close(ends[0]);
    const std::string closed = "/proc/self/fd/" + std::to_string(ends[1]);
    EXPECT_EQ(message_of([&] { write(closed, "x"); }),
              closed + ": cannot write: " + std::strerror(EPIPE));
    close(ends[1]);
}

TEST_F(WriteFile, AFullDiskLeavesTheOldFile) {
    const fs::path file = here_ / "a", link = here_ / "link", fresh = here_ / "fresh";
    write(file, "old");
    fs::create_symlink("a", link);
    const std::string large(100000, 'x');
    std::string messages[3];
    {
        const test::ResourceLimit limit(RLIMIT_FSIZE, 50000);
        messages[0] = message_of([&] { write(file, large); });
        messages[1] = message_of([&] { write(link, large); });
        messages[2] = message_of([&] { write(fresh, large); });
    }
    const std::string reason = std::string(": cannot write: ") + std::strerror(EFBIG);
    EXPECT_EQ(messages[0], file.string() + reason);
    EXPECT_EQ(messages[1], link.string() + reason);
    EXPECT_EQ(messages[2], fresh.string() + reason);
    EXPECT_EQ(content(file), "old");
    EXPECT_FALSE(fs::exists(fresh));
    EXPECT_EQ(entries(here_), 2u);
    const std::vector<float> values(100000, 1.0f);
    {
        const test::ResourceLimit limit(RLIMIT_FSIZE, 50000);
        messages[0] = message_of([&] { save_array(fresh, values); });
    }
    EXPECT_EQ(messages[0], fresh.string() + reason);
    EXPECT_FALSE(fs::exists(fresh));
    write(fresh, large);
    EXPECT_EQ(content(fresh), large);
}

TEST_F(WriteFile, ArraysHaveWholeRows) {
    const std::vector<float> values(7);
    const fs::path file = here_ / "array.npy";
    EXPECT_EQ(message_of([&] { save_array(file, values, 3); }),
              file.string() + ": values: 7 given, which fill no whole rows of 3");
    EXPECT_FALSE(fs::exists(file));
    save_array(file, std::vector<float>(), 3);
    EXPECT_TRUE(load_array(file, 3).empty());
    EXPECT_EQ(message_of([&] { static_cast<void>(load_array(file, 0)); }),
              file.string() + ": columns: 0 given, 1 or more are needed");
}

TEST_F(WriteFile, NamesTheReason) {
    const auto reason = [&](const fs::path& file) { return message_of([&] { write(file, "x"); }); };
    EXPECT_EQ(reason(here_), here_.string() + ": cannot write: " + std::strerror(EISDIR));
    EXPECT_EQ(reason(here_ / "absent" / "x"),
              (here_ / "absent" / "x").string() + ": cannot write: " + std::strerror(ENOENT));
    EXPECT_EQ(reason(""), std::string(": cannot write: ") + std::strerror(ENOENT));
    EXPECT_EQ(reason(here_ / "absent\n" / "x"),
              here_.string() + "/absent\\x0A/x: cannot write: " + std::strerror(ENOENT));
    const fs::path cut = here_ / std::string("cut\0short.png", 13);
    const std::string told =
        here_.string() + "/cut\\x00short.png: a path must not hold a NUL character";
    EXPECT_EQ(reason(cut), told);
    const Picture black{.width = 1, .height = 1, .pixels = {{0, 0, 0}}};
    EXPECT_EQ(message_of([&] { save_picture(cut, black, false); }), told);
    EXPECT_EQ(message_of([&] { (void)load_picture(cut); }), told);
    EXPECT_EQ(entries(here_), 0u);
    write(here_ / "locked", "old");
    fs::permissions(here_ / "locked", fs::perms::owner_read);
    if (access((here_ / "locked").c_str(), W_OK) != 0) {
        EXPECT_EQ(reason(here_ / "locked"),
                  (here_ / "locked").string() + ": cannot write: " + std::strerror(EACCES));
        EXPECT_EQ(content(here_ / "locked"), "old");
    }
}

}  // namespace
}  // namespace raydix
