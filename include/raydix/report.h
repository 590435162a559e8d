// One HTML page from the JSON documents that the raydix program writes: tables, plots, pictures
// (docs/report.md).
#pragma once

#include <raydix/picture.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace raydix {

/// A document that a command wrote with --json.
struct ReportDocument {
    std::string name;  // as the page shows it; usually the name of its file
    std::string json;
};

/// A picture as PNG bytes.
struct ReportPicture {
    std::string name, caption;
    std::uint32_t width = 0, height = 0;
    std::vector<std::byte> png;
};

/// Reads a .png file. Throws InputError that names the file if it cannot be read, is no whole PNG
/// picture, or has a side above 16,384.
[[nodiscard]] ReportPicture load_report_picture(const std::filesystem::path& file);

/// Turns a rendered picture into an 8-bit PNG, after a filmic curve if `tone_map`.
[[nodiscard]] ReportPicture make_report_picture(std::string name, std::string caption,
                                                const Picture& picture, bool tone_map);

struct ReportInput {
    std::string title = "raydix report";
    std::vector<ReportDocument> documents;
    std::vector<ReportPicture> pictures;
};

/// Makes the page as one text. It needs no script, font or picture from elsewhere. The same input
/// gives the same page. Fields that are absent, null or of another kind than expected are left out.
/// Unknown documents and fields are shown as plain tables. Two documents of one command are also
/// compared row by row. Simulated figures are labelled as such. Throws InputError "NAME: reason"
/// for a document that is not a JSON object.
[[nodiscard]] std::string make_report(const ReportInput& input);

/// What a document refers to, each once, in order: names of scenes, and picture files that `render`
/// wrote. For programs that add pictures.
struct ReportReferences {
    std::vector<std::string> scenes, pictures;
};
/// Throws InputError as make_report does.
[[nodiscard]] ReportReferences report_references(const ReportDocument& document);

/// Writes the page. Replaces the file and throws as write_file of files.h does.
void save_report(const std::filesystem::path& file, const std::string& html);

}  // namespace raydix
