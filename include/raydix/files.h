// How the library writes files, and which ones it reads.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// Makes `bytes` the content of `file`. Every call that saves a file writes as this one does:
/// - A regular file, or one that is not there yet, is replaced whole. The bytes go to a new file
///   beside it, to the disk, and only then take the name. A reader sees the old file or the new
///   one. If anything fails, the old file is as it was and nothing is left beside it. Permissions
///   stay. Other hard links to the old file keep the old content.
/// - A symbolic link stays. The file that it points to is replaced, or made if there is none.
/// - What is neither a file nor a folder, as a device or a pipe, is opened and written to. So is an
///   open descriptor of this process under its name, as /dev/stdout.
/// Throws InputError that names the file and the system's reason. A pipe that nobody reads any more
/// and a limit on the size of files are such reasons; they raise no signal.
void write_file(const std::filesystem::path& file, std::span<const std::byte> bytes);

/// The files that load_model reads for `spec`: the file itself, cameras.json beside it, and the
/// buffers that a glTF document names. Files that are not there are named, too. None for a built-in
/// scene. Throws InputError if `spec` is a glTF document that cannot be read.
[[nodiscard]] std::vector<std::filesystem::path> files_of_model(const std::string& spec);

}  // namespace raydix
