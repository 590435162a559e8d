#include "report/table.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "report/names.h"

namespace raydix::report {
namespace {

using Format = Column::Format;

bool holds(const std::string& html, const std::string& part) {
    return html.find(part) != std::string::npos;
}

TEST(TableHtml, NumbersOfAColumnHaveTheSameDigits) {
    Table table{.title = "T", .columns = {{"name"}, {"time", Format::number, "ms"}}};
    table.rows = {
        {"a", 1.25}, {"b", 1234.0}, {"c", Cell()}, {"d", std::numeric_limits<double>::quiet_NaN()}};
    const std::string html = table_html(table);
    EXPECT_TRUE(holds(html, ">1.2<") || holds(html, ">1.3<")) << html;
    EXPECT_TRUE(holds(html, ">1,234.0<")) << html;
    EXPECT_TRUE(holds(html, "data-v=\"1234\""));
    EXPECT_TRUE(holds(html, "data-v=\"1.25\""));  // sorting sees all digits
    EXPECT_EQ(html.find("nan"), std::string::npos);
    std::size_t dashes = 0;
    for (std::size_t at = 0; (at = html.find("class=\"none\"", at)) != std::string::npos; ++at)
        ++dashes;
    EXPECT_EQ(dashes, 2u);
}

TEST(TableHtml, FormatsAndOrigins) {
    Table table{.title = "T",
                .columns = {{"name"},
                            {"part", Format::percent},
                            {"ratio", Format::ratio},
                            {"count", Format::integer},
                            {"rate", Format::mixed, "Mrays/s", Origin::simulated}},
                .rows = {{"a", 0.5, 1.234, 1e6, 0.012345}}};
    const std::string html = table_html(table);
    EXPECT_TRUE(holds(html, "50.0 %"));
    EXPECT_TRUE(holds(html, "1.23 \xC3\x97"));
    EXPECT_TRUE(holds(html, "1,000,000"));
    EXPECT_TRUE(holds(html, "0.01235") || holds(html, "0.01234"));
    EXPECT_TRUE(holds(html, "badge simulated"));
    EXPECT_TRUE(holds(html, "Mrays/s"));
}

TEST(TableHtml, TextIsEscaped) {
    const std::string attack = "\"><script>x</script>";
    Cell cell(attack);
    cell.tip = attack;
    cell.swatch = attack;
    Table table{.title = attack, .note = attack, .columns = {{attack, Format::text, attack}}};
    table.columns[0].help = attack;
    table.rows = {{cell}};
    const std::string html = table_html(table);
    EXPECT_EQ(html.find("<script"), std::string::npos);
    EXPECT_EQ(html.find("\"\">"), std::string::npos);
}

TEST(TableHtml, OddShapes) {
    EXPECT_EQ(table_html({}), "");
    Table ragged{.title = "T", .columns = {{"a"}, {"b", Format::number}}};
    ragged.rows = {{}, {"x"}, {"x", 1.0, "more than there are columns"}};
    const std::string html = table_html(ragged);
    EXPECT_FALSE(holds(html, "more than"));
    Table big{.title = "T", .columns = {{"a"}}};
    big.rows.assign(most_table_rows + 5, {Cell("row")});
    EXPECT_TRUE(holds(table_html(big), "5 further rows"));
}

TEST(Table, DropsColumnsThatSayNothing) {
    Table table{.title = "T", .columns = {{"a"}, {"b", Format::number}, {"c"}, {"d"}}};
    table.rows = {{"x", Cell(), "", "y"}, {"x", 0.0}};
    table.drop_empty_columns();
    ASSERT_EQ(table.columns.size(), 3u);
    EXPECT_EQ(table.columns[1].title, "b");
    EXPECT_EQ(table.columns[2].title, "d");
    EXPECT_EQ(table.rows[0].back().text, "y");
}

TEST(DistinctNames, SayOnlyWhatDiffers) {
    const Names names = distinct_names(
        {{"bvh", "karras", "63 bits", "2 threads"}, {"bvh", "ploc", "63 bits", "1 thread"}}, 1);
    EXPECT_EQ(names.each, (std::vector<std::string>{"karras, 2 threads", "ploc, 1 thread"}));
    EXPECT_EQ(names.common, "bvh, 63 bits");
    EXPECT_EQ(distinct_names({{"", "karras", "63 bits"}}, 1).each[0], "karras");
    EXPECT_EQ(distinct_names({{"", ""}}, 1).each[0], "without a name");
    EXPECT_TRUE(distinct_names({}, 0).each.empty());
    EXPECT_EQ(distinct_names({{"a", "x"}, {"a"}}, 0).each, (std::vector<std::string>{"a, x", "a"}));
}

TEST(Listed, ReadsAsASentence) {
    EXPECT_EQ(listed({}), "");
    EXPECT_EQ(listed({"a"}), "a");
    EXPECT_EQ(listed({"a", "b"}), "a and b");
    EXPECT_EQ(listed({"a", "b", "c"}), "a, b and c");
    EXPECT_EQ(counted(1, "thread"), "1 thread");
    EXPECT_EQ(counted(2, "thread"), "2 threads");
}

}  // namespace
}  // namespace raydix::report
