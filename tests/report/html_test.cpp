#include "report/html.h"

#include <gtest/gtest.h>

#include <span>
#include <string>

namespace raydix::report {
namespace {

TEST(Escaped, KeepsMarkupFromBeingMarkup) {
    EXPECT_EQ(escaped("<script>alert('x')</script>"),
              "&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;");
    EXPECT_EQ(escaped("\" onload=\"x&y"), "&quot; onload=&quot;x&amp;y");
    EXPECT_EQ(escaped("plain text\n\tand more"), "plain text\n\tand more");
    EXPECT_EQ(escaped(""), "");
}

TEST(Escaped, ReplacesWhatIsNoText) {
    const std::string replaced = "\xEF\xBF\xBD";
    EXPECT_EQ(escaped(std::string("a\0b", 3)), "a" + replaced + "b");
    EXPECT_EQ(escaped("a\x1B[31m\x7F"), "a" + replaced + "[31m" + replaced);
    EXPECT_EQ(escaped("caf\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x98\x80"),
              "caf\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x98\x80");
    for (const char* bad : {"\xFF", "\xC3", "\xC0\xBC", "\xE0\x80\xBC", "\xED\xA0\x80",
                            "\xF4\x90\x80\x80", "\xF0\x80\x80\xBC"}) {
        const std::string out = escaped(bad);
        EXPECT_EQ(out.find_first_not_of(replaced), std::string::npos) << out;
        EXPECT_GE(out.size(), replaced.size());
    }
    // A lead byte must not swallow the markup behind it.
    EXPECT_EQ(escaped("\xE2<b>"), replaced + "&lt;b&gt;");
}

TEST(Breakable, OffersBreaksInLongNames) {
    EXPECT_EQ(breakable("while_while"), "while_<wbr>while");
    EXPECT_EQ(breakable("builtin:figure?triangles=5000"),
              "builtin:figure?<wbr>triangles=<wbr>5000");
    EXPECT_EQ(breakable("<&>"), "&lt;&amp;<wbr>&gt;");
}

TEST(IdOf, IsSafeInAnAttribute) {
    EXPECT_EQ(id_of("Scenes and checks"), "scenes-and-checks");
    EXPECT_EQ(id_of("\"><script>"), "script");
    EXPECT_EQ(id_of("\xC3\xA9"), "x");
    EXPECT_EQ(id_of(""), "x");
}

TEST(Shortened, CutsByCodePoints) {
    EXPECT_EQ(shortened("abcdef", 6), "abcdef");
    EXPECT_EQ(shortened("abcdefg", 6), "abcde\xE2\x80\xA6");
    EXPECT_EQ(shortened("\xC3\xA9\xC3\xA9\xC3\xA9", 2), "\xC3\xA9\xE2\x80\xA6");
    EXPECT_EQ(shortened("ab", 1), "\xE2\x80\xA6");
}

TEST(Base64, VectorsOfRfc4648) {
    const auto encoded = [](const std::string& text) {
        return base64(std::as_bytes(std::span(text)));
    };
    EXPECT_EQ(encoded(""), "");
    EXPECT_EQ(encoded("f"), "Zg==");
    EXPECT_EQ(encoded("fo"), "Zm8=");
    EXPECT_EQ(encoded("foo"), "Zm9v");
    EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
    EXPECT_EQ(encoded("\xFF\xFE\xFD"), "//79");
}

}  // namespace
}  // namespace raydix::report
