// What the library throws. It never exits, aborts or prints.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace raydix {

/// The input is at fault: a file, a mesh, an option. The message is one line that says where and
/// why. A change or a commit of a scene that throws it has changed nothing.
class InputError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A call would hold more than the option `max_result_bytes` allows: the result, and what the call
/// needs on the way. The message names the bytes. Nothing of the result is returned.
class ResultTooLarge : public InputError {
public:
    /// `exact`: the call needs `bytes`. Otherwise it needs more than that; it stopped before it
    /// knew how many.
    ResultTooLarge(const std::string& what, std::uint64_t bytes, bool exact, std::uint64_t limit)
        : InputError(what + ": the result needs " + (exact ? "" : "more than ") +
                     std::to_string(bytes) + " bytes; max_result_bytes lets it have " +
                     std::to_string(limit)),
          bytes_(bytes),
          exact_(exact) {}

    [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
    [[nodiscard]] bool is_exact() const { return exact_; }

private:
    std::uint64_t bytes_;
    bool exact_;
};

/// The call asks for a device or a feature that this build or this machine does not have.
class BackendUnavailable : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A device call failed. The message holds the expression, the place and the driver's text.
class DeviceError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

}  // namespace raydix
