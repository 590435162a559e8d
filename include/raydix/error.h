// What the library throws. It never exits, aborts or prints.
#pragma once

#include <stdexcept>
#include <string>

namespace raydix {

/// The input is at fault: a file, a mesh, an option value. The message is one line that says where
/// and why.
class InputError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
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
