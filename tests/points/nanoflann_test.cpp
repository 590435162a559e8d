// Against nanoflann, where it is installed: an index of another make, in both scalars.
#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/points.h>

#include <algorithm>
#include <cmath>

#include "support/point_reference.h"
#include "support/support.h"

#if __has_include(<nanoflann.hpp>)
#include <nanoflann.hpp>

namespace raydix::test {
namespace {

template <class Index>
struct Cloud {
    const std::vector<typename Index::Point>& points;

    [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
    [[nodiscard]] typename Index::Scalar kdtree_get_pt(std::size_t i, std::size_t d) const {
        return (&points[i].x)[d];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
        return false;
    }
};

template <class Index>
class Nanoflann : public ::testing::Test {};
using Indices = ::testing::Types<Points, Points2, PointsD, Points2D>;
TYPED_TEST_SUITE(Nanoflann, Indices);

TYPED_TEST(Nanoflann, TheSameDistancesAndNumbers) {
    using T = typename TypeParam::Scalar;
    using Tree =
        nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<T, Cloud<TypeParam>>,
                                            Cloud<TypeParam>, TypeParam::dimension, std::uint32_t>;
    const std::string count = std::to_string(1000 * thorough);
    for (const char* kind : {"uniform", "clustered"}) {
        const Model scene = load_model("builtin:" + std::string(kind) + "?points=" + count, 3);
        const auto points = points_as<TypeParam>(scene.mesh().vertices);
        const TypeParam index = build_points(points);
        const Cloud<TypeParam> cloud{points};
        Tree tree(TypeParam::dimension, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
        tree.buildIndex();
        const std::uint32_t k = 8;
        const auto nearest = knn(index, points, k);
        const T radius = nearest.distances[k * points.size() / 2];
        std::vector<std::uint32_t> counts(points.size());
        radius_count(index, points, radius, counts);
        nanoflann::SearchParams unsorted;
        unsorted.sorted = false;
        std::vector<std::pair<std::uint32_t, T>> found;
        std::vector<std::uint32_t> ids(k);
        std::vector<T> d2(k);
        for (std::size_t q = 0; q < points.size(); ++q) {
            nanoflann::KNNResultSet<T, std::uint32_t, std::uint32_t> result(k);
            result.init(ids.data(), d2.data());
            tree.findNeighbors(result, &points[q].x, nanoflann::SearchParams());
            for (std::uint32_t i = 0; i < k; ++i)
                ASSERT_EQ(nearest.distances[q * k + i], std::sqrt(d2[i])) << kind << ", " << q;
            // It asks for d2 < the bound.
            tree.radiusSearch(&points[q].x,
                              std::nextafter(radius * radius, std::numeric_limits<T>::infinity()),
                              found, unsorted);
            ASSERT_EQ(counts[q], found.size()) << kind << ", " << q;
        }
    }
}

}  // namespace
}  // namespace raydix::test
#endif
