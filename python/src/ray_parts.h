// Rays as callers have them: origins and directions in arrays of any strides, float32 or float64.
// The library's rays are of one of the two; this is the one place where others become so.
#pragma once

#include <raydix/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "arrays.h"

namespace raydix::python {

using StridedRows = nb::ndarray<nb::ro, nb::shape<-1, 3>, nb::device::cpu>;
/// One limit for all rays, or one for each.
using Limits = std::variant<double, nb::ndarray<nb::ro, nb::ndim<1>, nb::device::cpu>>;

/// Columns of rays [n]. `RayType` is Ray, for which float64 is rounded to the nearest, or RayD.
template <class RayType>
class RayParts {
public:
    RayParts(const RayParts&) = delete;  // columns may point at members
    RayParts& operator=(const RayParts&) = delete;
    /// Throws nb::type_error if a dtype is neither float32 nor float64, nb::value_error if the
    /// lengths differ.
    RayParts(const StridedRows& origins, const StridedRows& directions, const Limits& tmin,
             const Limits& tmax);

    [[nodiscard]] std::size_t size() const { return size_; }
    /// Rays [begin, end), in memory that the next call uses again.
    [[nodiscard]] std::span<const RayType> piece(std::size_t begin, std::size_t end);

private:
    struct Column {
        const std::byte* data = nullptr;
        std::int64_t row_bytes = 0, column_bytes = 0;
    };

    template <class Scalar>
    void fill(std::size_t begin, std::size_t end);
    template <class Array>
    [[nodiscard]] Column column(const Array& array, const char* name);
    [[nodiscard]] Column limit(const Limits& limits, const char* name, std::size_t which);

    // Before the columns: the first of them says what all must be.
    std::size_t size_ = 0;
    bool is_double_ = false;
    std::array<float, 2> floats_{};  // what a column of one limit points at, in either type
    std::array<double, 2> doubles_{};
    Column origins_, directions_, tmin_, tmax_;
    std::vector<RayType> rays_;
};

extern template class RayParts<Ray>;
extern template class RayParts<RayD>;

/// Rays of shape (n, 8) and of the library's type are its own: the same memory.
template <class RayType>
class RayRows {
public:
    using Array = In<decltype(RayType::tmin), nb::shape<-1, 8>>;

    explicit RayRows(const Array& rays) : rays_(rows<RayType>(rays)) {}
    [[nodiscard]] std::size_t size() const { return rays_.size(); }
    [[nodiscard]] std::span<const RayType> piece(std::size_t begin, std::size_t end) {
        return rays_.subspan(begin, end - begin);
    }

private:
    std::span<const RayType> rays_;
};

/// Types of a call's arguments behind the rays.
template <class... Types>
struct MoreArguments {};

/// Defines `name` for both forms of rays: ask(self, rays, more...), where `names` are of `more`.
template <class RayType, class Self, class Ask, class... More, class... Names>
void def_for_rays(nb::class_<Self>& bound, const char* name, const Ask& ask, MoreArguments<More...>,
                  const Names&... names) {
    using Rows = RayRows<RayType>;
    bound
        .def(
            name,
            [ask](Self& self, const typename Rows::Array& rays, More... more) {
                Rows batch(rays);
                return ask(self, batch, more...);
            },
            nb::arg("rays").noconvert(), names...)
        .def(
            name,
            [ask](Self& self, const StridedRows& origins, const StridedRows& directions,
                  const Limits& tmin, const Limits& tmax, More... more) {
                RayParts<RayType> batch(origins, directions, tmin, tmax);
                return ask(self, batch, more...);
            },
            nb::arg("origins").noconvert(), nb::arg("directions").noconvert(),
            nb::arg("tmin").noconvert(), nb::arg("tmax").noconvert(), names...);
}

}  // namespace raydix::python
