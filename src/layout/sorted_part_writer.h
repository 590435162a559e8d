// The parts of a group, one after the other: triangles into blocks, leaves and boxes from left to
// right (the climb of tree/apetrei_cpu.h), the best children of each subtree on the way (the plans
// of collapse_plan.h), then wide nodes from the root down. Part of part_kernels.cpp alone.
#if defined(RAYDIX_LAYOUT_SORTED_PART_WRITER) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_LAYOUT_SORTED_PART_WRITER
#undef RAYDIX_LAYOUT_SORTED_PART_WRITER
#else
#define RAYDIX_LAYOUT_SORTED_PART_WRITER
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

template <int width>
class SortedPartWriter {
public:
    SortedPartWriter(const PartInput& in, const PartGroup& group, PartEntries<width>& entries,
                     WidePart& out)
        : in_(in), group_(group), entries_(entries), out_(out) {}

    void run() {
        // As few as make little difference to memory: to grow again and again costs new pages.
        out_.nodes.reserve((group_.parts.back().end - group_.parts.front().begin) / 10 + 1);
        for (std::size_t p = 0; p < group_.parts.size(); ++p) {
            const SortedPart& part = group_.parts[p];
            const std::uint32_t root = climb(part.begin, part.end);
            in_.progress.add(0.5 * (part.end - part.begin));
            const Entry& entry = entries_[root];
            const std::uint32_t word = is_whole(root) ? entry.link : write_nodes(root, part.depth);
            in_.progress.add(0.5 * (part.end - part.begin));
            group_.roots[p] = {{entry.lo, entry.hi}, odds(entry), word};
        }
    }

    // What choose_children asks.
    [[nodiscard]] const CollapsePlan<width>& plan_of(std::uint32_t k) const {
        return entries_[k].plan;
    }
    [[nodiscard]] bool is_whole(std::uint32_t k) const {
        return (entries_[k].link & wide_leaf_bit) != 0;
    }
    [[nodiscard]] std::array<std::uint32_t, 2> parts_of(std::uint32_t k) const {
        return {entries_[k].link, k - 1};
    }

private:
    using Entry = PartEntry<width>;
    static constexpr std::size_t most_open = 1 + 63 + 32;  // the prefixes that wait all differ
    using Order = SlotOrder;
    /// In the place of a child that there is none of.
    static constexpr Entry no_entry{{infinity, infinity, infinity},
                                    wide_no_child,
                                    {-infinity, -infinity, -infinity},
                                    infinity,
                                    {}};
    struct Open {
        std::uint32_t entry, prefix;
    };
    struct Waiting {
        std::uint32_t entry, parent, slot, depth;
    };

    /// Enters the subtree of keys [begin, end), from left to right; what waits for its right
    /// sibling lies on a stack whose prefixes grow towards the top. Returns the root.
    std::uint32_t climb(std::uint32_t begin, std::uint32_t end) {
        entries_.reset(2 * std::size_t{end - begin});
        const std::uint8_t* const prefixes = in_.triangles.prefixes.at(0);
        std::array<Open, most_open + 1> open;
        open[0] = {0, 0};
        std::size_t top = 0;
        std::uint32_t next = 0;
        for (std::uint32_t k = begin; k < end;) {
            const std::uint32_t count = std::min(leaf_size(k), end - k);
            add_leaf(entries_[next++], k, count);
            k += count;
            // Behind the last leaf: shorter than all prefixes inside.
            const std::uint32_t prefix = prefixes[k - 1];
            for (; open[top].prefix > prefix; --top) {
                add_inner(open[top].entry, next);
                ++next;
            }
            open[++top] = {next - 1, prefix};
        }
        return next - 1;
    }

    /// How many keys there are up to the next split that is kept.
    [[nodiscard]] std::uint32_t leaf_size(std::uint32_t k) const {
        std::uint64_t bits;
        std::memcpy(&bits, reinterpret_cast<const std::uint8_t*>(in_.kept) + k / 8, sizeof(bits));
        return 1 + static_cast<std::uint32_t>(std::countr_zero(bits >> k % 8 | 8));
    }

    void add_leaf(Entry& entry, std::uint32_t first, std::uint32_t count) {
        constexpr std::size_t indices_ahead = 32, corners_ahead = 16;
        const TriangleSource& source = in_.triangles.source;
        const std::span<const std::uint32_t> order = in_.triangles.order;
        const std::uint32_t place = out_.filler.place(count), lane = place % block_lanes;
        TriangleBlock& block = group_.blocks[place / block_lanes];
        if (lane == 0) block = TriangleBlock{};
        Box3 box = Box3::load(empty_box());
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::size_t at = std::size_t{first} + k;
            if (at + indices_ahead < order.size()) {
                prefetch_indices(source, order[at + indices_ahead]);
                prefetch_corners(source, order[at + corners_ahead]);
            }
            const LeafTriangle corners = copy_primitive(source, order[at]);
            box = unite(box, copy_box(corners));
            block.set(lane + k, corners, order[at]);
        }
        const Aabb plain = box.box();
        entry.lo = plain.lo;
        entry.hi = plain.hi;
        entry.link = wide_leaf_bit | place << 3 | (count - 1);
        const float area = area_of(entry);
        entry.hits = hits_of_leaf(area);
        set_leaf_plan(area * static_cast<float>(count) * static_cast<float>(wide_primitive_cost),
                      entry.plan);
    }

    /// Entry `k`, with the one before it as right child.
    void add_inner(std::uint32_t left, std::uint32_t k) {
        const Entry &a = entries_[left], &b = entries_[k - 1];
        Entry& entry = entries_[k];
        const Box3 box = unite(Box3::load(a.lo, a.hi), Box3::load(b.lo, b.hi));
        box.lo.store(entry.lo);
        box.hi.store(entry.hi);
        entry.link = left;
        const float area = area_of(entry);
        entry.hits = joined_hits(a.hits, b.hits, area);
        join_plans(a.plan, b.plan, area, entry.plan);
    }
    static void join_plans(const CollapsePlan<width>& a, const CollapsePlan<width>& b,
                           float node_cost, CollapsePlan<width>& out) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
        if constexpr (width == 8) return make_plan_within_avx2(a, b, node_cost, out);
#endif
        make_plan<width>(cheapest_shares<width>(a.cost.data(), b.cost.data()), node_cost, infinity,
                         out);
    }
    static void set_leaf_plan(float cost, CollapsePlan<width>& out) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
        if constexpr (width == 8) return set_leaf_plan_within_avx2(cost, out);
#endif
        out.cost.fill(cost);
        out.choices = 1;
    }
    static float area_of(const Entry& entry) {
        const float x = entry.hi.x - entry.lo.x, y = entry.hi.y - entry.lo.y,
                    z = entry.hi.z - entry.lo.z;
        return x * y + y * z + z * x;
    }

    /// Depth first: what rays visit together lies together. Returns the number of the first node.
    std::uint32_t write_nodes(std::uint32_t root, std::uint32_t depth) {
        constexpr std::uint32_t no_parent = ~std::uint32_t{0};
        const auto first = static_cast<std::uint32_t>(out_.nodes.size());
        waiting_.assign(1, {root, no_parent, 0, depth});
        while (!waiting_.empty()) {
            const Waiting at = waiting_.back();
            waiting_.pop_back();
            const auto w = static_cast<std::uint32_t>(out_.nodes.size());
            if (at.parent != no_parent) out_.nodes[at.parent].child[at.slot] = w;
            write_node(out_.nodes.emplace_back(), w, at);
        }
        return first;
    }

    void write_node(WideNode& node, std::uint32_t w, const Waiting& at) {
        std::array<std::uint32_t, width> chosen;
        const auto count =
            static_cast<std::uint32_t>(choose_children<width>(*this, at.entry, chosen));
        const Order order = write_slots(chosen, count, node);
        WideSums& sums = out_.sums;
        for (std::uint32_t s = 0; s < count; ++s) {
            const std::uint32_t k = chosen[order[s]];
            const Entry& child = entries_[k];
            if ((child.link & wide_leaf_bit) != 0) {
                const std::uint32_t triangles = (child.link & 7) + 1;
                ++sums.leaves;
                sums.references += triangles;
                sums.triangle_area += half_area({child.lo, child.hi}) * triangles;
            } else {
                waiting_.push_back({k, w, s, at.depth + 1});
            }
        }
        sums.children += count;
        sums.node_area += half_area({entries_[at.entry].lo, entries_[at.entry].hi});
        sums.levels = std::max(sums.levels, at.depth + 1);
    }

    static SearchOdds odds(const Entry& entry) { return {entry.hits, entry.plan.cost[0]}; }

    /// Boxes and links of the children, by ascending search_rank: rays that stop at any hit take
    /// the last slot first. Equal ranks keep their order, which is returned.
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
    Order write_slots(const std::array<std::uint32_t, width>& chosen, std::uint32_t count,
                      WideNode& node) const {
        static_assert(offsetof(Entry, plan) == sizeof(__m256));
        EightRows rows;
        alignas(32) std::array<float, 8> costs;
        for (std::uint32_t s = 0; s < 8; ++s) {
            const bool there = s < width && s < count;
            const Entry* const entry = there ? &entries_[chosen[s]] : &no_entry;
            rows[s] = _mm256_load_ps(reinterpret_cast<const float*>(entry));
            costs[s] = entry->plan.cost[0];
        }
        return write_slots_within_avx2(rows, _mm256_load_ps(costs.data()), in_.middle, node);
    }
#else
    Order write_slots(const std::array<std::uint32_t, width>& chosen, std::uint32_t count,
                      WideNode& node) const {
        Order order{};
        std::iota(order.begin(), order.end(), 0u);
        order_for_search(std::span(order).first(count),
                         [&](std::uint32_t child) { return odds(entries_[chosen[child]]); });
        SlotBoxes boxes{};
        std::fill_n(node.child, quantised_width, wide_no_child);
        for (std::uint32_t s = 0; s < count; ++s) {
            const Entry& child = entries_[chosen[order[s]]];
            boxes.set(static_cast<int>(s), {child.lo, child.hi});
            node.child[s] = child.link;
        }
        set_boxes_about(in_.middle, boxes, node);
        return order;
    }
#endif

    const PartInput& in_;
    const PartGroup& group_;
    PartEntries<width>& entries_;
    WidePart& out_;
    std::vector<Waiting> waiting_;
};

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
