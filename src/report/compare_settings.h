// Documents -> what their runs were told and where they ran.
#pragma once

#include "report/compare_rows.h"

namespace raydix::report {

/// Machine, version, seed, builder, bits, camera, ...; equal names once. A name that a document
/// says nothing of is left out.
[[nodiscard]] Settings settings_of(const Document& document);

/// A setting of which two documents do not say the same. "": one of them says nothing.
struct DifferentSetting {
    std::string name, first, second;
};
[[nodiscard]] std::vector<DifferentSetting> different_settings(const Document& first,
                                                               const Document& second);

}  // namespace raydix::report
