// What a run compared and what it found.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace raydix::attack {

/// A wrong answer, with all that is needed to get it again.
struct Finding {
    std::string kind, what;  // `what` is the same for all findings of one sort
    std::uint64_t seed = 0, index = 0;
    std::string reproducer;  // numbers in hexadecimal
};

class Tally {
public:
    /// Findings of one sort whose reproducers are kept; the others are only counted.
    static constexpr std::uint64_t kept = 2;

    void count_case(std::string_view kind) { ++add_to(cases_, kind); }
    /// `answers` were compared; `group` says of what, for example "rays".
    void compared(std::string_view group, std::uint64_t answers) {
        add_to(compared_, group) += answers;
    }
    /// How often this sort was found so far.
    std::uint64_t seen(std::string_view kind, std::string_view what) const;
    void found(Finding finding);

    [[nodiscard]] std::uint64_t cases() const { return sum(cases_); }
    [[nodiscard]] std::uint64_t comparisons() const { return sum(compared_); }
    [[nodiscard]] std::uint64_t findings() const { return sum(found_); }
    [[nodiscard]] const std::map<std::string, std::uint64_t, std::less<>>& compared_groups() const {
        return compared_;
    }

    void merge(const Tally& other);
    void print() const;
    /// One JSON object: cases, comparisons, findings and their reproducers. False if the file
    /// cannot be written.
    [[nodiscard]] bool write_json(const std::string& file, std::uint64_t seed,
                                  double seconds) const;

private:
    using Counts = std::map<std::string, std::uint64_t, std::less<>>;
    static std::uint64_t& add_to(Counts& counts, std::string_view key);
    static std::uint64_t sum(const Counts& counts);

    Counts cases_, compared_, found_;
    std::vector<Finding> examples_;
};

}  // namespace raydix::attack
