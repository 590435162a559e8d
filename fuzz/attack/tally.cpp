// Counts of a run -> text and JSON.
#include "attack/tally.h"

#include <cstdio>
#include <utility>

namespace raydix::attack {
namespace {

std::string json_text(std::string_view text) {
    std::string made = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') {
            made += '\\';
            made += c;
        } else if (c == '\n') {
            made += "\\n";
        } else {
            made += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
        }
    }
    return made + "\"";
}

void write_counts(std::FILE* out, const char* name,
                  const std::map<std::string, std::uint64_t, std::less<>>& counts) {
    std::fprintf(out, "  \"%s\": {", name);
    const char* before = "\n";
    for (const auto& [key, value] : counts) {
        std::fprintf(out, "%s    %s: %llu", before, json_text(key).c_str(),
                     static_cast<unsigned long long>(value));
        before = ",\n";
    }
    std::fprintf(out, "\n  },\n");
}

}  // namespace

std::uint64_t& Tally::add_to(Counts& counts, std::string_view key) {
    const auto at = counts.find(key);
    return at != counts.end() ? at->second : counts.emplace(std::string(key), 0).first->second;
}

std::uint64_t Tally::sum(const Counts& counts) {
    std::uint64_t total = 0;
    for (const auto& [key, value] : counts) total += value;
    return total;
}

std::uint64_t Tally::seen(std::string_view kind, std::string_view what) const {
    const auto at = found_.find(std::string(kind) + ": " + std::string(what));
    return at == found_.end() ? 0 : at->second;
}

void Tally::found(Finding finding) {
    std::uint64_t& count = add_to(found_, finding.kind + ": " + finding.what);
    if (++count <= kept) examples_.push_back(std::move(finding));
}

void Tally::merge(const Tally& other) {
    for (const auto& [key, value] : other.cases_) add_to(cases_, key) += value;
    for (const auto& [key, value] : other.compared_) add_to(compared_, key) += value;
    for (const Finding& finding : other.examples_)
        if (seen(finding.kind, finding.what) < kept) examples_.push_back(finding);
    for (const auto& [key, value] : other.found_) add_to(found_, key) += value;
}

void Tally::print() const {
    for (const auto& [kind, count] : cases_)
        std::printf("%-12s %12llu cases\n", kind.c_str(), static_cast<unsigned long long>(count));
    std::printf("\n%-56s %16s\n", "compared", "answers");
    for (const auto& [group, count] : compared_)
        std::printf("%-56s %16llu\n", group.c_str(), static_cast<unsigned long long>(count));
    for (const Finding& finding : examples_)
        std::printf("\nFOUND %s: %s (--kinds %s --seed %llu --case %llu)\n%s", finding.kind.c_str(),
                    finding.what.c_str(), finding.kind.c_str(),
                    static_cast<unsigned long long>(finding.seed),
                    static_cast<unsigned long long>(finding.index), finding.reproducer.c_str());
    if (!found_.empty()) std::printf("\n%-86s %8s\n", "findings", "times");
    for (const auto& [what, count] : found_)
        std::printf("%-86s %8llu\n", what.c_str(), static_cast<unsigned long long>(count));
    std::printf("\n%llu cases, %llu answers compared, %llu findings\n",
                static_cast<unsigned long long>(cases()),
                static_cast<unsigned long long>(comparisons()),
                static_cast<unsigned long long>(findings()));
}

bool Tally::write_json(const std::string& file, std::uint64_t seed, double seconds) const {
    std::FILE* out = std::fopen(file.c_str(), "w");
    if (out == nullptr) return false;
    std::fprintf(out, "{\n  \"seed\": %llu,\n  \"seconds\": %.3f,\n",
                 static_cast<unsigned long long>(seed), seconds);
    write_counts(out, "cases", cases_);
    write_counts(out, "compared", compared_);
    write_counts(out, "findings", found_);
    std::fprintf(out, "  \"examples\": [");
    const char* before = "\n";
    for (const Finding& finding : examples_) {
        std::fprintf(out,
                     "%s    {\"kind\": %s, \"what\": %s, \"seed\": %llu, \"case\": %llu, "
                     "\"reproducer\": %s}",
                     before, json_text(finding.kind).c_str(), json_text(finding.what).c_str(),
                     static_cast<unsigned long long>(finding.seed),
                     static_cast<unsigned long long>(finding.index),
                     json_text(finding.reproducer).c_str());
        before = ",\n";
    }
    std::fprintf(out, "\n  ]\n}\n");
    return std::fclose(out) == 0;
}

}  // namespace raydix::attack
