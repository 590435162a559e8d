// Strided columns of rays -> pieces of rays of the library's types.
#include "ray_parts.h"

#include <cstring>
#include <string>

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
    const auto read = [](const Column& column, std::size_t row, int axis) {
        Scalar value;  // copied, because a caller's array may lie at any byte
        std::memcpy(&value,
                    column.data + static_cast<std::int64_t>(row) * column.row_bytes +
                        axis * column.column_bytes,
                    sizeof value);
        return static_cast<decltype(RayType::tmin)>(value);
    };
    for (std::size_t i = begin; i < end; ++i)
        rays_[i - begin] = {
            {read(origins_, i, 0), read(origins_, i, 1), read(origins_, i, 2)},
            read(tmin_, i, 0),
            {read(directions_, i, 0), read(directions_, i, 1), read(directions_, i, 2)},
            read(tmax_, i, 0)};
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
