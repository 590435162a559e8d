// Documents and pictures -> the page: parse all, ask each kind of section, put them in order.
#include <raydix/error.h>
#include <raydix/files.h>
#include <raydix/report.h>
#include <raydix/version.h>

#include <fmt/format.h>
#include <algorithm>
#include <fstream>
#include <span>

#include "report/html.h"
#include "report/picture_codec.h"
#include "report/sections.h"

namespace raydix {
namespace {

using namespace report;

Section picture_section(const std::vector<ReportPicture>& pictures) {
    Section section{.id = "pictures", .title = "Pictures"};
    for (const ReportPicture& picture : pictures) {
        section.html += fmt::format(
            "<figure><img src=\"data:image/png;base64,{}\" width=\"{}\" height=\"{}\" alt=\"{}\">"
            "<figcaption><span class=\"title\">{}</span>",
            base64(picture.png), picture.width, picture.height,
            escaped(picture.name + (picture.caption.empty() ? "" : ": " + picture.caption)),
            breakable(picture.name));
        if (!picture.caption.empty())
            section.html += "<span class=\"subtitle\">" + escaped(picture.caption) + "</span>";
        section.html += "</figcaption></figure>\n";
    }
    if (!section.html.empty())
        section.html = "<div class=\"pictures\">\n" + section.html + "</div>\n";
    return section;
}

/// "Made by raydix 0.1.0 from 3 documents, run on AMD EPYC, 2 cores, avx512"
std::string subtitle_of(const Documents& documents) {
    std::vector<std::string> machines;
    for (const Document& document : documents)
        if (const std::string machine = machine_text(document);
            std::ranges::find(machines, machine) == machines.end())
            machines.push_back(machine);
    std::string text = fmt::format("From {} {}", documents.size(),
                                   documents.size() == 1 ? "document" : "documents");
    if (!machines.empty()) {
        text += " of runs on ";
        for (std::size_t i = 0; i < machines.size(); ++i)
            text += (i == 0 ? "" : i + 1 == machines.size() ? " and on " : "; on ") + machines[i];
    }
    return fmt::format("{}. Page made by raydix {}.", text, version);
}

Documents parse_all(const std::vector<ReportDocument>& documents) {
    Documents parsed;
    for (const ReportDocument& document : documents)
        parsed.push_back(parse_document(document.name, document.json));
    return parsed;
}

void add_once(std::vector<std::string>& names, const std::string& name) {
    if (!name.empty() && std::ranges::find(names, name) == names.end()) names.push_back(name);
}

}  // namespace

std::string make_report(const ReportInput& input) {
    const Documents documents = parse_all(input.documents);
    PageColours colours;
    Page page{.title = input.title, .subtitle = subtitle_of(documents)};
    page.sections.push_back(compare_section(documents));
    page.sections.push_back(build_section(documents, colours));
    page.sections.push_back(trace_section(documents));
    page.sections.push_back(traversal_section(documents, colours));
    page.sections.push_back(simulate_section(documents, colours));
    page.sections.push_back(hierarchy_section(documents, colours));
    page.sections.push_back(ranks_section(documents));
    page.sections.push_back(picture_section(input.pictures));
    page.sections.push_back(scene_section(documents));
    page.sections.push_back(other_section(documents));
    page.sections.push_back(sources_section(documents));
    return page_html(page);
}

ReportReferences report_references(const ReportDocument& document) {
    const Document parsed = parse_document(document.name, document.json);
    ReportReferences references;
    add_once(references.scenes, text_at(parsed.root, "scene.name"));
    for (const char* list : {"simulate", "measured", "runs", "builds"})
        for (const Json* row : objects_at(parsed.root, list))
            if (text_at(*row, "series") != "size")  // a series over sizes is not worth pictures
                add_once(references.scenes, text_at(*row, "scene"));
    add_once(references.pictures, text_at(parsed.root, "render.file"));
    return references;
}

ReportPicture load_report_picture(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    if (!in) throw InputError(file.string() + ": cannot be read");
    ReportPicture picture{.name = file.filename().string(), .caption = {}, .png = {}};
    const auto all = std::as_bytes(std::span(bytes));
    try {
        const Picture decoded = decode_png(all);
        picture.width = decoded.width;
        picture.height = decoded.height;
    } catch (const std::runtime_error& error) {
        throw InputError(file.string() + ": " + error.what());
    }
    picture.png.assign(all.begin(), all.end());
    return picture;
}

ReportPicture make_report_picture(std::string name, std::string caption, const Picture& picture,
                                  bool tone_map) {
    return {.name = std::move(name),
            .caption = std::move(caption),
            .width = picture.width,
            .height = picture.height,
            .png = encode_png(picture, tone_map)};
}

void save_report(const std::filesystem::path& file, const std::string& html) {
    write_file(file, std::as_bytes(std::span(html)));
}

}  // namespace raydix
