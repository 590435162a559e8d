// Copies of meshes -> one mesh of all of them, behind each other.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "exec/parallel.h"

namespace raydix {

/// Calls body(copy, begin, end) for ranges of elements of each copy, shared out over the threads
/// however many elements a copy has. `first`: where its elements begin among `total`.
template <class Copy, class Body>
void for_each_part_of_copies(std::span<const Copy> copies, std::uint64_t Copy::*first,
                             std::size_t total, const Body& body) {
    for_each_range(total, 4096, [&](std::size_t begin, std::size_t end) {
        const auto past = std::upper_bound(
            copies.begin(), copies.end(), begin,
            [&](std::size_t element, const Copy& copy) { return element < copy.*first; });
        for (auto at = past - 1; begin < end; ++at) {
            const std::size_t stop =
                at + 1 == copies.end() ? total : static_cast<std::size_t>((*(at + 1)).*first);
            const std::size_t last = std::min(end, stop), before = (*at).*first;
            if (begin < last) body(*at, begin - before, last - before);
            begin = std::max(begin, last);
        }
    });
}

/// Copy: `mesh`, a view; first_vertex and first_triangle, where it goes, each ascending from 0;
/// mirrors(), whether two corners of each triangle change places, so that the outside stays
/// outside; mover(), a function of a vertex. `vertices`, `triangles`: of all of them.
template <class Copy, class AnyMesh>
void join_copies(std::span<const Copy> copies, std::size_t vertices, std::size_t triangles,
                 AnyMesh& out) {
    out.vertices.resize(vertices);
    out.triangles.resize(triangles);
    for_each_part_of_copies(copies, &Copy::first_vertex, vertices,
                            [&](const Copy& copy, std::size_t begin, std::size_t end) {
                                const auto move = copy.mover();
                                for (std::size_t i = begin; i < end; ++i)
                                    out.vertices[copy.first_vertex + i] =
                                        move(copy.mesh.vertices[i]);
                            });
    for_each_part_of_copies(
        copies, &Copy::first_triangle, triangles,
        [&](const Copy& copy, std::size_t begin, std::size_t end) {
            const bool mirrors = copy.mirrors();
            const auto first = static_cast<std::uint32_t>(copy.first_vertex);
            for (std::size_t i = begin; i < end; ++i) {
                std::array<std::uint32_t, 3> t = copy.mesh.triangles[i];
                if (mirrors) std::swap(t[1], t[2]);
                out.triangles[copy.first_triangle + i] = {t[0] + first, t[1] + first, t[2] + first};
            }
        });
}

}  // namespace raydix
