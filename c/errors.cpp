// Errors of the C interface: exceptions -> statuses, and a message for each thread.
#include <new>

#include "inside.h"

namespace raydix_c {
namespace {

std::string& last_message() {
    thread_local std::string message;
    return message;
}

raydix_status failed(raydix_status status, const char* message) noexcept {
    try {
        last_message() = message;
    } catch (...) {  // no memory for it: what stood there before would be of another call
        last_message().clear();
    }
    return status;
}

}  // namespace

raydix_status status_of_exception() noexcept {
    try {
        throw;
    } catch (const raydix::ResultTooLarge& error) {
        return failed(RAYDIX_RESULT_TOO_LARGE, error.what());
    } catch (const raydix::InputError& error) {
        return failed(RAYDIX_INPUT_ERROR, error.what());
    } catch (const raydix::BackendUnavailable& error) {
        return failed(RAYDIX_UNAVAILABLE, error.what());
    } catch (const std::bad_alloc&) {
        return failed(RAYDIX_OUT_OF_MEMORY, "out of memory");
    } catch (const std::exception& error) {
        return failed(RAYDIX_INTERNAL_ERROR, error.what());
    } catch (...) {
        return failed(RAYDIX_INTERNAL_ERROR, "an exception of unknown type");
    }
}

}  // namespace raydix_c

extern "C" {

const char* raydix_last_error() { return raydix_c::last_message().c_str(); }

const char* raydix_version() { return raydix::version; }

}  // extern "C"
