// What several commands ask of options before any work: whole numbers, files that can be written,
// options that do not go together.
#pragma once

#include <CLI/CLI.hpp>

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <string>

namespace raydix::cli {

/// For add_option(...)->transform: decimal digits, whose leading zeros it drops. `check` in its
/// place would leave those to CLI11, which takes them for octal.
[[nodiscard]] CLI::Validator whole_number(
    std::uint64_t least, std::uint64_t most = std::numeric_limits<std::uint64_t>::max());

/// Usage error of the first of `names` that was given: `why` follows the name. For options that
/// would be ignored.
void refuse_given(const CLI::App& command, std::initializer_list<const char*> names,
                  const std::string& why);
[[nodiscard]] bool is_given(const CLI::App& command, const char* name);

/// For add_option(...)->check: a name that is not empty, as that of a shell's variable without a
/// value is.
[[nodiscard]] CLI::Validator file_name();

/// Usage error where a file that the command writes is one that it reads, or is written twice;
/// those that a name stands for are among them (--out PREFIX, cameras beside a scene). A tree may
/// take the place of the one it was read from (build -o). For the program's parse_complete.
void refuse_shared_files(const CLI::App& program);

/// Where each ray's hits begin, beside the hits of --mode all.
[[nodiscard]] std::string offsets_file(const std::string& hits_file);

/// Before the work of which `file` takes the result, as far as can be told then. Empty: nothing to
/// check. Throws InputError as writing would.
void require_writable(const std::string& file);

}  // namespace raydix::cli
