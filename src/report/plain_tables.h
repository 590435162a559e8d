// Any JSON -> plain tables, for what no section knows: lists of objects as rows, the rest as names
// and values. What lies too deep or is too long is named, not shown.
#pragma once

#include <string>

#include "report/fields.h"
#include "report/figure.h"

namespace raydix::report {

[[nodiscard]] std::string plain_tables(const std::string& title, const Json& value,
                                       Origin origin = Origin::none);

}  // namespace raydix::report
