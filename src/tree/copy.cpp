#include "tree/copy.h"

#include <algorithm>

#include "exec/parallel.h"
#include "tree/bvh_access.h"
#include "tree/bvh_d_access.h"

namespace raydix {
namespace {

template <class T>
void copy(std::span<const T> from, Buffer<T>& to) {
    to.reset(from.size());
    for_each_range(from.size(), 1u << 14, [&](std::size_t begin, std::size_t end) {
        std::copy(from.begin() + static_cast<std::ptrdiff_t>(begin),
                  from.begin() + static_cast<std::ptrdiff_t>(end), to.data() + begin);
    });
}

void copy(const Bvh& from, const BvhAccess& to) {
    copy(from.nodes(), to.nodes());
    copy(from.order(), to.order());
    copy(from.triangles(), to.triangles());
    copy(from.boxes(), to.boxes());
    copy(from.points(), to.points());
    to.kind() = from.kind();
    to.options() = from.options();
    to.inner_count() = from.inner_count();
    to.max_depth() = from.max_depth();
    to.input_count() = from.input_count();
    to.left_out() = from.left_out();
    to.refitted() = from.refitted();
    to.build_ms() = from.build_ms();
    to.peak_bytes() = from.peak_bytes();
}

}  // namespace

BvhD copy_of(const BvhD& from) {
    BvhD to;
    const BvhDAccess access{to};
    copy(from.tree(), {access.tree()});
    copy(from.triangles(), access.triangles());
    access.center() = from.center();
    access.scale() = from.scale();
    access.bounds() = from.bounds();
    access.build_ms() = from.build_ms();
    return to;
}

}  // namespace raydix
