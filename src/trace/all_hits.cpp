#include "trace/all_hits.h"

#include "trace/hit_rows.h"

namespace raydix {

namespace {

/// Of hits by found_by.
struct RowsOfTree {
    static std::uint32_t ray(const Hit& hit) { return hit.instance; }
    static Hit bare(Hit hit) {
        hit.instance = 0;
        return hit;
    }
    static bool is_before(const Hit& a, const Hit& b) {
        return a.t != b.t ? a.t < b.t : a.prim < b.prim;
    }
    static bool same(const Hit& a, const Hit& b) { return a.prim == b.prim; }
};

}  // namespace

std::uint64_t group_by_ray(BudgetVector<Hit>& hits, std::size_t before, std::size_t rays,
                           std::uint64_t* hit_counts) {
    return put_in_rows(hits, before, {hit_counts, rays}, RowsOfTree());
}

}  // namespace raydix
