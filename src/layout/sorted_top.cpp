#include "layout/sorted_top.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "exec/parallel.h"
#include "layout/leaf_order.h"
#include "primitives/host_box.h"
#include "tree/byte_scan.h"

namespace raydix {
namespace {

/// Subtrees of fewer keys stay whole.
constexpr std::uint32_t least_opened = 64;

std::uint8_t least_of(const std::uint8_t* begin, const std::uint8_t* end) {
    std::uint8_t least = 255;
    for (; begin != end; ++begin) least = std::min(least, *begin);
    return least;
}

/// Finds the split of a subtree: that of the least prefix, of which there is one.
class SplitFinder {
public:
    SplitFinder(const NeighbourPrefixes& prefixes, Buffer<std::uint8_t>& minima)
        : prefixes_(prefixes.at(0)) {
        const std::size_t splits = prefixes.count() - 1, chunks = splits / chunk;
        minima.reset(chunks + 16);  // scans read whole sixteens
        for_each_index(
            chunks,
            [&](std::size_t c) {
                minima[c] = least_of(prefixes_ + c * chunk, prefixes_ + (c + 1) * chunk);
            },
            1024);
        std::fill_n(minima.data() + chunks, 16, std::uint8_t{0});
        minima_ = minima.data();
    }

    /// Of keys [begin, end), at least two: the last key on the left.
    [[nodiscard]] std::uint32_t split(std::uint32_t begin, std::uint32_t end) const {
        const std::uint32_t last = end - 1, first_chunk = (begin + chunk - 1) / chunk,
                            last_chunk = last / chunk;
        if (first_chunk >= last_chunk) return place_in(begin, last);
        const std::uint8_t within = least_of(minima_ + first_chunk, minima_ + last_chunk);
        const std::uint8_t before = least_of(prefixes_ + begin, prefixes_ + first_chunk * chunk);
        const std::uint8_t behind = least_of(prefixes_ + last_chunk * chunk, prefixes_ + last);
        if (before < within && before < behind) return place_in(begin, first_chunk * chunk);
        if (behind < within) return place_in(last_chunk * chunk, last);
        const std::uint32_t c = first_chunk + find_byte(minima_ + first_chunk, within);
        return place_in(c * chunk, (c + 1) * chunk);
    }

private:
    static constexpr std::uint32_t chunk = 64;

    /// Among splits [begin, end).
    [[nodiscard]] std::uint32_t place_in(std::uint32_t begin, std::uint32_t end) const {
        return begin + find_byte(prefixes_ + begin, least_of(prefixes_ + begin, prefixes_ + end));
    }

    const std::uint8_t* prefixes_;
    const std::uint8_t* minima_;
};

/// Knows about how large the boxes of subtrees are, by every so-many-th of their triangles.
class BoxSampler {
public:
    BoxSampler(const SortedTriangles& triangles, TopBuffers& memory)
        : samples_(memory.samples), chunks_(memory.chunks) {
        const std::size_t count = (triangles.order.size() + stride - 1) / stride;
        samples_.reset(count);
        chunks_.reset((count + chunk - 1) / chunk);
        for_each_block(count, chunk, [&](std::size_t c, std::size_t begin, std::size_t end) {
            constexpr std::size_t indices_ahead = 16, corners_ahead = 8;
            Box3 all = Box3::load(empty_box());
            for (std::size_t k = begin; k < end; ++k) {
                if (k + indices_ahead < count) {
                    prefetch_indices(triangles.source,
                                     triangles.order[(k + indices_ahead) * stride]);
                    prefetch_corners(triangles.source,
                                     triangles.order[(k + corners_ahead) * stride]);
                }
                const Box3 box = valid_box(triangles.source, triangles.order[k * stride]);
                samples_[k] = box.box();
                all = unite(all, box);
            }
            chunks_[c] = all.box();
        });
    }

    /// Of keys [begin, end), at least `stride`: half of the surface of the samples' box.
    [[nodiscard]] double area(std::uint32_t begin, std::uint32_t end) const {
        const std::size_t first = (begin + stride - 1) / stride, last = (end + stride - 1) / stride;
        const std::size_t first_chunk = (first + chunk - 1) / chunk, last_chunk = last / chunk;
        Box3 all = Box3::load(empty_box());
        const auto add = [&](const Buffer<Aabb>& boxes, std::size_t from, std::size_t to) {
            for (std::size_t k = from; k < to; ++k) all = unite(all, Box3::load(boxes[k]));
        };
        if (first_chunk >= last_chunk) {
            add(samples_, first, last);
        } else {
            add(samples_, first, first_chunk * chunk);
            add(chunks_, first_chunk, last_chunk);
            add(samples_, last_chunk * chunk, last);
        }
        return half_area(all.box());
    }

private:
    static constexpr std::size_t stride = 16, chunk = 32;

    Buffer<Aabb>& samples_;
    Buffer<Aabb>& chunks_;
};

/// Keys [begin, end).
struct Range {
    std::uint32_t begin, end;
    double area;  // -1 if it stays whole

    [[nodiscard]] std::uint32_t size() const { return end - begin; }
};

class TopMaker {
public:
    TopMaker(const SplitFinder& finder, const BoxSampler& sampler, std::uint32_t width)
        : finder_(finder), sampler_(sampler), width_(width) {}

    SortedTop run(std::uint32_t n) {
        waiting_.push_back({{0, n, infinity}, {TopSlot::no_node, 0}, 0});
        while (!waiting_.empty()) {
            const Waiting at = waiting_.back();
            waiting_.pop_back();
            add_node(at);
        }
        std::ranges::sort(top_.parts, {}, &SortedPart::begin);
        return std::move(top_);
    }

private:
    static constexpr std::size_t most_children = 8;
    struct Waiting {
        Range range;
        TopSlot parent;
        std::uint32_t depth;
    };

    [[nodiscard]] Range range_of(std::uint32_t begin, std::uint32_t end) const {
        return {begin, end, end - begin < least_opened ? -1 : sampler_.area(begin, end)};
    }

    /// The largest child is replaced by its two while there is room.
    void add_node(const Waiting& at) {
        std::array<Range, most_children> children;
        children[0] = at.range;
        std::uint32_t count = 1;
        while (count < width_) {
            Range* const largest =
                std::max_element(children.begin(), children.begin() + count,
                                 [](const Range& a, const Range& b) { return a.area < b.area; });
            if (largest->area < 0) break;
            const Range open = *largest;
            const std::uint32_t middle = finder_.split(open.begin, open.end) + 1;
            std::move_backward(largest + 1, children.begin() + count, children.begin() + count + 1);
            largest[0] = range_of(open.begin, middle);
            largest[1] = range_of(middle, open.end);
            ++count;
        }
        const auto node = static_cast<std::uint32_t>(top_.nodes.size());
        top_.nodes.push_back({at.parent, at.depth, count});
        for (std::uint32_t k = count; k-- > 0;) {
            const Range& child = children[k];
            if (child.size() > most_in_part)
                waiting_.push_back({child, {node, k}, at.depth + 1});
            else
                top_.parts.push_back({child.begin, child.end, {node, k}, at.depth + 1});
        }
    }

    const SplitFinder& finder_;
    const BoxSampler& sampler_;
    std::uint32_t width_;
    SortedTop top_;
    std::vector<Waiting> waiting_;
};

}  // namespace

SortedTop make_sorted_top(const SortedTriangles& triangles, std::uint32_t width,
                          std::uint32_t max_leaf, TopBuffers& memory) {
    const auto n = static_cast<std::uint32_t>(triangles.order.size());
    constexpr TopSlot no_slot{TopSlot::no_node, 0};
    if (n <= max_leaf) return {{{no_slot, 0, 1}}, {{0, n, {0, 0}, 1}}};
    if (n <= most_in_part) return {{}, {{0, n, no_slot, 0}}};
    const SplitFinder finder(triangles.prefixes, memory.least_prefixes);
    const BoxSampler sampler(triangles, memory);
    return TopMaker(finder, sampler, width).run(n);
}

}  // namespace raydix
