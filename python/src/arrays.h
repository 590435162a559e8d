// Arrays between Python and the library: views of the caller's, and results whose memory goes over.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace raydix::python {

namespace nb = nanobind;

template <class T, class Shape>
using In = nb::ndarray<const T, Shape, nb::c_contig, nb::device::cpu>;
template <class T, class Shape>
using Out = nb::ndarray<T, Shape, nb::c_contig, nb::device::cpu>;

using PointsIn = In<float, nb::shape<-1, 3>>;
using FacesIn = In<std::uint32_t, nb::shape<-1, 3>>;
using RaysIn = In<float, nb::shape<-1, 8>>;
using HitsOut = Out<float, nb::shape<-1, 6>>;

/// The rows of an array as structs of the same size.
template <class Row, class Array>
[[nodiscard]] std::span<const Row> rows(const Array& array) {
    static_assert(alignof(Row) <= alignof(typename Array::Scalar));
    return {reinterpret_cast<const Row*>(array.data()), array.shape(0)};
}
template <class Row, class Array>
[[nodiscard]] std::span<Row> rows_out(const Array& array) {
    static_assert(alignof(Row) <= alignof(typename Array::Scalar));
    return {reinterpret_cast<Row*>(array.data()), array.shape(0)};
}

template <class T>
using Array1 = nb::ndarray<nb::numpy, T, nb::ndim<1>>;
template <class T>
using Array2 = nb::ndarray<nb::numpy, T, nb::ndim<2>>;

/// Something that holds memory becomes an owner that Python can keep.
template <class Holder>
[[nodiscard]] nb::capsule owner_of(std::unique_ptr<Holder> holder) {
    nb::capsule owner(holder.get(), [](void* held) noexcept { delete static_cast<Holder*>(held); });
    static_cast<void>(holder.release());
    return owner;
}

/// A vector or Buffer as an array of shape (n,), without a copy.
template <class Holder>
[[nodiscard]] auto hand_over(Holder&& values) {
    using Kept = std::remove_cvref_t<Holder>;
    using T = std::remove_cvref_t<decltype(*values.data())>;
    auto kept = std::make_unique<Kept>(std::forward<Holder>(values));
    T* const data = kept->data();
    const std::size_t size = kept->size();
    return Array1<T>(data, {size}, owner_of(std::move(kept)));
}

/// The same for structs of T: shape (n, sizeof(struct) / sizeof(T)).
template <class T, class Holder>
[[nodiscard]] Array2<T> hand_over_rows(Holder&& values) {
    using Kept = std::remove_cvref_t<Holder>;
    using Row = std::remove_cvref_t<decltype(*values.data())>;
    static_assert(sizeof(Row) % sizeof(T) == 0);
    auto kept = std::make_unique<Kept>(std::forward<Holder>(values));
    T* const data = reinterpret_cast<T*>(kept->data());
    const std::size_t size = kept->size();
    return Array2<T>(data, {size, sizeof(Row) / sizeof(T)}, owner_of(std::move(kept)));
}

/// A view of memory that `owner` holds: shape (n, sizeof(struct) / sizeof(T)), read-only.
template <class T, class Row>
[[nodiscard]] Array2<const T> view_rows(std::span<const Row> values, nb::handle owner) {
    static_assert(sizeof(Row) % sizeof(T) == 0);
    return Array2<const T>(reinterpret_cast<const T*>(values.data()),
                           {values.size(), sizeof(Row) / sizeof(T)}, owner);
}

}  // namespace raydix::python
