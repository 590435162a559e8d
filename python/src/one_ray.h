// One ray between Python and the library by the buffer protocol: half of what a call with one ray
// takes would otherwise be the making of array objects.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstring>

namespace raydix::python {

namespace nb = nanobind;

/// An object's memory, if it has any to show.
class BufferView {
public:
    BufferView(nb::handle object, int flags)
        : filled_(PyObject_GetBuffer(object.ptr(), &view_, flags) == 0) {
        if (!filled_) PyErr_Clear();
    }
    ~BufferView() {
        if (filled_) PyBuffer_Release(&view_);
    }
    BufferView(const BufferView&) = delete;
    BufferView& operator=(const BufferView&) = delete;

    explicit operator bool() const { return filled_; }
    const Py_buffer* operator->() const { return &view_; }

private:
    Py_buffer view_{};
    bool filled_;
};

template <class Scalar, class Vector>
void read_numbers(const char* data, std::ptrdiff_t step, Vector& vector) {
    Scalar numbers[3];
    for (int i = 0; i < 3; ++i) std::memcpy(&numbers[i], data + i * step, sizeof(Scalar));
    using To = decltype(vector.x);
    vector = {static_cast<To>(numbers[0]), static_cast<To>(numbers[1]),
              static_cast<To>(numbers[2])};
}

/// Three numbers of type float32 or float64 and shape (3,) or (1, 3), rounded to those of `vector`.
/// Returns how many dimensions there are; 0: it is something else.
template <class Vector>
int read_vector(nb::handle object, Vector& vector) {
    const BufferView view(object, PyBUF_FORMAT | PyBUF_STRIDES);
    if (!view || view->format == nullptr || view->format[0] == 0 || view->format[1] != 0) return 0;
    const int n = view->ndim;
    if ((n != 1 && n != 2) || view->shape[n - 1] != 3 || (n == 2 && view->shape[0] != 1)) return 0;
    const char* const data = static_cast<const char*>(view->buf);
    if (view->format[0] == 'f')
        read_numbers<float>(data, view->strides[n - 1], vector);
    else if (view->format[0] == 'd')
        read_numbers<double>(data, view->strides[n - 1], vector);
    else
        return 0;
    return n;
}

/// Throws nb::value_error unless the object is writable memory of exactly so many bytes in one run.
inline void write_bytes(nb::handle object, const void* bytes, std::size_t size) {
    const BufferView view(object, PyBUF_WRITABLE);
    if (!view || static_cast<std::size_t>(view->len) != size)
        throw nb::value_error("a result has another length than its queries");
    std::memcpy(view->buf, bytes, size);
}

}  // namespace raydix::python
