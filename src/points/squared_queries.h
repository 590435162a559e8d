// The queries of an index of points with d2 in place of distances, for callers that join the
// answers of several indices: a rounded root makes ties where there are none.
#pragma once

#include <raydix/points.h>

#include <cstdint>
#include <span>

namespace raydix {

/// As knn. Of query i only points with d2 <= most_d2[i] count. The caller checks sizes and k.
template <class Index>
QueryCounts squared_nearest(const Index& index, PointsOf<Index> queries,
                            const typename Index::Scalar* most_d2, std::uint32_t k,
                            std::span<std::uint32_t> indices, ScalarsOf<Index> d2,
                            const PointQueryOptions& options);

/// As radius_search. The caller checks the radii.
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> squared_radius_search(
    const Index& index, PointsOf<Index> queries,
    std::type_identity_t<std::span<const typename Index::Scalar>> radii,
    const PointQueryOptions& options);

}  // namespace raydix
