// Strided columns of rays -> pieces of rays of the library's types.
#include "ray_parts.h"

#include <cstring>
#include <string>
#include <type_traits>

namespace raydix::python {

template <class RayType>
template <class Array>
RayParts<RayType>::Column RayParts<RayType>::column(const Array& array, const char* name) {
    const auto dtype = array.dtype();
    const bool is_double = dtype == nb::dtype<double>();
    if (!is_double && dtype != nb::dtype<float>())
        throw nb::type_error((std::string(name) + ": expected float32 or float64").c_str());
    if (name != std::string("origins") && (is_double != is_double_ || array.shape(0) != size_))
        throw nb::value_error((std::string(name) + " and origins differ").c_str());
    is_double_ = is_double;
    size_ = array.shape(0);
    const std::int64_t bytes = is_double ? sizeof(double) : sizeof(float);
    return {static_cast<const std::byte*>(array.data()), array.stride(0) * bytes,
            array.ndim() == 2 ? array.stride(1) * bytes : 0};
}

template <class RayType>
RayParts<RayType>::Column RayParts<RayType>::limit(const Limits& limits, const char* name,
                                                   std::size_t which) {
    if (const auto* array = std::get_if<1>(&limits)) return column(*array, name);
    doubles_[which] = std::get<0>(limits);
    floats_[which] = static_cast<float>(doubles_[which]);
    const void* const data = is_double_ ? static_cast<const void*>(&doubles_[which])
                                        : static_cast<const void*>(&floats_[which]);
    return {static_cast<const std::byte*>(data), 0, 0};
}

template <class RayType>
RayParts<RayType>::RayParts(const StridedRows& origins, const StridedRows& directions,
                            const Limits& tmin, const Limits& tmax)
    : origins_(column(origins, "origins")),
      directions_(column(directions, "directions")),
      tmin_(limit(tmin, "tmin", 0)),
      tmax_(limit(tmax, "tmax", 1)) {}

template <class RayType>
template <class Scalar>
void RayParts<RayType>::fill(std::size_t begin, std::size_t end) {
    using To = decltype(RayType::tmin);
    const auto read = [](const std::byte* at) {
        Scalar value;  // copied, because a caller's array may lie at any byte
        std::memcpy(&value, at, sizeof value);
        return static_cast<To>(value);
    };
    const auto row = [](const Column& column, std::size_t i) {
        return column.data + static_cast<std::int64_t>(i) * column.row_bytes;
    };
    const auto fill_by = [&](auto origin_step, auto direction_step) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::byte* const origin = row(origins_, i);
            const std::byte* const direction = row(directions_, i);
            rays_[i - begin] = {
                {read(origin), read(origin + origin_step), read(origin + 2 * origin_step)},
                read(row(tmin_, i)),
                {read(direction), read(direction + direction_step),
                 read(direction + 2 * direction_step)},
                read(row(tmax_, i))};
        }
    };
    constexpr std::integral_constant<std::int64_t, sizeof(Scalar)> together;  // the usual case
    if (origins_.column_bytes == together && directions_.column_bytes == together)
        fill_by(together, together);
    else
        fill_by(origins_.column_bytes, directions_.column_bytes);
}

template <class RayType>
std::span<const RayType> RayParts<RayType>::piece(std::size_t begin, std::size_t end) {
    rays_.resize(end - begin);
    if (is_double_)
        fill<double>(begin, end);
    else
        fill<float>(begin, end);
    return rays_;
}

template class RayParts<Ray>;
template class RayParts<RayD>;

}  // namespace raydix::python
