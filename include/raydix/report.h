// One HTML page from the JSON documents that the raydix program writes: tables, plots, pictures.
#pragma once

#include <raydix/picture.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace raydix {

/// A document as a command wrote it with --json.
struct ReportDocument {
    std::string name;  // shown: the name of its file
    std::string json;
};

/// A picture as PNG bytes.
struct ReportPicture {
    std::string name, caption;
    std::uint32_t width = 0, height = 0;
    std::vector<std::byte> png;
};

/// Reads a .png file. Throws InputError that names the file if it is not a whole PNG picture.
[[nodiscard]] ReportPicture load_report_picture(const std::filesystem::path& file);

/// A rendered picture as 8-bit PNG, after a filmic curve if `tone_map`.
[[nodiscard]] ReportPicture make_report_picture(std::string name, std::string caption,
                                                const Picture& picture, bool tone_map);

struct ReportInput {
    std::string title = "raydix report";
    std::vector<ReportDocument> documents;
    std::vector<ReportPicture> pictures;
};

/// The page as one text: no script, font or picture from elsewhere; the same input gives the same
/// page. Fields that are absent, null or of another kind than expected are left out, unknown
/// documents and fields are shown as plain tables. Two documents of one command are also compared
/// row by row. Everything simulated is labelled as such. Throws InputError "NAME: reason" for a
/// document that is no JSON object.
[[nodiscard]] std::string make_report(const ReportInput& input);

/// What documents refer to, for programs that add pictures: scenes by name and picture files as
/// `render` wrote them, each once, in order.
struct ReportReferences {
    std::vector<std::string> scenes, pictures;
};
/// Throws InputError as make_report does.
[[nodiscard]] ReportReferences report_references(const ReportDocument& document);

/// Writes the page; a reader sees the old file or the new one, never half of either. Throws
/// InputError that names the file.
void save_report(const std::filesystem::path& file, const std::string& html);

}  // namespace raydix
