// What a finished tree can say of itself.
#include <raydix/bvh.h>
#include <raydix/error.h>

#include <array>
#include <utility>

#include "base/math.h"

namespace raydix {
namespace {

constexpr std::array<std::pair<Builder, std::string_view>, 10> builder_names{
    {{Builder::karras, "karras"},
     {Builder::lauterbach, "lauterbach"},
     {Builder::garanzha, "garanzha"},
     {Builder::apetrei, "apetrei"},
     {Builder::ploc, "ploc"},
     {Builder::hploc, "hploc"},
     {Builder::binned, "binned"},
     {Builder::sweep, "sweep"},
     {Builder::split, "split"},
     {Builder::sbvh, "sbvh"}}};

}  // namespace

std::string_view builder_name(Builder builder) {
    for (const auto& [value, name] : builder_names)
        if (value == builder) return name;
    return "unknown";
}

Builder builder_from_name(std::string_view name) {
    std::string known;
    for (const auto& [value, known_name] : builder_names) {
        if (known_name == name) return value;
        known += known.empty() ? "" : ", ";
        known += known_name;
    }
    throw InputError("unknown builder '" + std::string(name) + "'; known: " + known);
}

void detail::refuse_quality(int number) {
    throw InputError("option quality is " + std::to_string(number) + "; it must be 0 to 2");
}

Aabb Bvh::bounds() const { return empty() ? empty_box() : Aabb{nodes_[0].lo, nodes_[0].hi}; }

std::uint64_t Bvh::bytes() const {
    const auto bytes_of = [](const auto& buffer) { return buffer.view().size_bytes(); };
    return bytes_of(nodes_) + bytes_of(order_) + bytes_of(triangles_) + bytes_of(boxes_) +
           bytes_of(points_);
}

}  // namespace raydix
