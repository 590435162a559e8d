// What an error says.
#pragma once

#include <raydix/error.h>

#include <string>

namespace raydix::test {

/// The text of the InputError that `call` throws; "no error" if it throws none.
template <class Call>
std::string message_of(const Call& call) {
    try {
        call();
    } catch (const InputError& error) {
        return error.what();
    }
    return "no error";
}

}  // namespace raydix::test
