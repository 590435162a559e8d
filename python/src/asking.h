// What rays and other queries share that Python asks scenes: arrays of both types of scenes, and
// batches in pieces.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstdint>
#include <utility>

#include "arrays.h"
#include "batch.h"
#include "locks.h"

namespace raydix::python {

using Counts = std::pair<std::uint64_t, std::uint64_t>;  // hits or found, invalid
using FlagsOut = Out<bool, nb::ndim<1>>;

/// Throws what an output of another length deserves: memory past its end is not ours.
inline void require_length(std::size_t length, std::size_t wanted) {
    if (length != wanted) throw nb::value_error("a result has another length than its queries");
}

// What both types of scenes call by the same names.
template <class Scene>
using Scalar = typename Scene::Types::Scalar;
template <class Scene>
using Point = typename Scene::Types::Point;
template <class Scene>
using PointRows = In<Scalar<Scene>, nb::shape<-1, 3>>;
template <class Scene>
using ValuesOut = Out<Scalar<Scene>, nb::ndim<1>>;

/// As in_pieces, and the trees stay as they are from the first piece to the last.
template <class Scene, class Body>
void read_in_pieces(Scene& scene, std::size_t n, const Body& body,
                    std::size_t first = first_piece) {
    Reading lock;
    in_pieces(
        n,
        [&](std::size_t begin, std::size_t end) {
            if (!lock.owns_lock()) lock = scene.read();
            body(begin, end);
        },
        first);
}

/// Runs call() without the interpreter's lock and with the trees held.
template <class Scene, class Call>
auto reading(Scene& scene, const Call& call) {
    const nb::gil_scoped_release unlocked;
    const auto lock = scene.read();
    return call();
}

}  // namespace raydix::python
