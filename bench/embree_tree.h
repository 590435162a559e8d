// Embree's binary tree over our boxes, built through its callbacks, and the same tree as a Bvh, so
// that one kernel traces both and one function computes SAH for both.
#pragma once

#include <raydix/bvh.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/math.h"
#include "embree_api.h"
#include "tree/bvh_internals.h"
#include "tree/spatial_split.h"

namespace raydix::bench {

class EmbreeTree {
public:
    EmbreeTree(const MeshView& mesh, int threads, int max_leaf,
               RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM)
        : mesh_(mesh),
          max_leaf_(max_leaf),
          quality_(quality),
          device_(rtcNewDevice(("threads=" + std::to_string(threads)).c_str())),
          bvh_(rtcNewBVH(device_)) {
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
            const Triangle& t = mesh.triangles[i];
            const Aabb b = box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
            primitives_.push_back(
                {b.lo.x, b.lo.y, b.lo.z, 0, b.hi.x, b.hi.y, b.hi.z, static_cast<unsigned>(i)});
        }
        work_.resize(quality == RTC_BUILD_QUALITY_HIGH ? 2 * primitives_.size()
                                                       : primitives_.size());
    }
    ~EmbreeTree() {
        rtcReleaseBVH(bvh_);
        rtcReleaseDevice(device_);
    }
    EmbreeTree(const EmbreeTree&) = delete;
    EmbreeTree& operator=(const EmbreeTree&) = delete;

    /// The builder reorders its input: to be called before each build, outside of the time.
    void refill() { std::copy(primitives_.begin(), primitives_.end(), work_.begin()); }

    /// Quality MEDIUM: binned SAH; HIGH: with spatial splits. Costs 1 and 1, two children a node.
    void build() {
        RTCBuildArguments a = rtcDefaultBuildArguments();
        a.buildQuality = quality_;
        a.maxBranchingFactor = 2;
        a.maxDepth = 64;
        a.sahBlockSize = 1;
        a.minLeafSize = 1;
        a.maxLeafSize = static_cast<unsigned>(max_leaf_);
        a.traversalCost = 1.0f;
        a.intersectionCost = 1.0f;
        a.bvh = bvh_;
        a.primitives = work_.data();
        a.primitiveCount = primitives_.size();
        a.primitiveArrayCapacity = work_.size();
        a.splitPrimitive = split;
        a.userPtr = this;
        a.createNode = create_inner;
        a.setNodeChildren = set_children;
        a.setNodeBounds = set_bounds;
        a.createLeaf = create_leaf;
        root_ = static_cast<Node*>(rtcBuildBVH(&a));
        if (const RTCError error = rtcGetDeviceError(device_); error != RTC_ERROR_NONE)
            throw std::runtime_error("Embree reports error " + std::to_string(error));
    }

    /// The tree just built, over the same mesh, nodes in preorder.
    [[nodiscard]] Bvh as_bvh(const MeshView& mesh) const {
        std::vector<BvhNode> nodes(2, BvhNode{});
        std::vector<std::uint32_t> order;
        std::uint32_t deepest = 0;
        struct Waiting {
            const Node* node;
            std::uint32_t slot, depth;
        };
        std::vector<Waiting> waiting{{root_, 0, 0}};
        while (!waiting.empty()) {
            const Waiting at = waiting.back();
            waiting.pop_back();
            deepest = std::max(deepest, at.depth);
            const auto first =
                static_cast<std::uint32_t>(at.node->count != 0 ? order.size() : nodes.size());
            const Aabb& box = at.node->count != 0 ? at.node->box[0] : at.node->both();
            nodes[at.slot] = {box.lo, first, box.hi, at.node->count};
            if (at.node->count != 0) {
                order.insert(order.end(), at.node->ids, at.node->ids + at.node->count);
                continue;
            }
            nodes.resize(nodes.size() + 2);
            waiting.push_back({at.node->children[1], first + 1, at.depth + 1});
            waiting.push_back({at.node->children[0], first, at.depth + 1});
        }
        return assemble(mesh, nodes, order, deepest);
    }

private:
    struct Node {
        unsigned count;  // 0: inner
        Node* children[2];
        Aabb box[2];  // of the children; a leaf's own is the first
        unsigned ids[8];

        [[nodiscard]] Aabb both() const { return unite(box[0], box[1]); }
    };

    static void* create_inner(RTCThreadLocalAllocator allocator, unsigned, void*) {
        auto* node = static_cast<Node*>(rtcThreadLocalAlloc(allocator, offsetof(Node, ids), 16));
        node->count = 0;
        return node;
    }
    static void set_children(void* node, void** children, unsigned, void*) {
        for (int k = 0; k < 2; ++k)
            static_cast<Node*>(node)->children[k] = static_cast<Node*>(children[k]);
    }
    static void set_bounds(void* node, const RTCBounds** bounds, unsigned, void*) {
        for (int k = 0; k < 2; ++k) {
            const RTCBounds& b = *bounds[k];
            static_cast<Node*>(node)->box[k] = {{b.lower_x, b.lower_y, b.lower_z},
                                                {b.upper_x, b.upper_y, b.upper_z}};
        }
    }
    static void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives,
                             std::size_t count, void*) {
        auto* node = static_cast<Node*>(rtcThreadLocalAlloc(allocator, sizeof(Node), 16));
        node->count = static_cast<unsigned>(count);
        node->box[0] = empty_box();
        for (std::size_t k = 0; k < count; ++k) {
            const RTCBuildPrimitive& p = primitives[k];
            node->box[0] = unite(node->box[0], {{p.lower_x, p.lower_y, p.lower_z},
                                                {p.upper_x, p.upper_y, p.upper_z}});
            node->ids[k] = p.primID;
        }
        return node;
    }

    /// Boxes of the parts of a triangle on both sides of a plane, cut as our own builder does.
    static void split(const RTCBuildPrimitive* primitive, unsigned axis, float plane,
                      RTCBounds* left, RTCBounds* right, void* self) {
        const Aabb whole{{primitive->lower_x, primitive->lower_y, primitive->lower_z},
                         {primitive->upper_x, primitive->upper_y, primitive->upper_z}};
        const ReferenceCutter cutter(static_cast<const EmbreeTree*>(self)->mesh_);
        const CutReference parts =
            cutter.cut(SplitBox::of(whole, primitive->primID, 1), axis, plane);
        const auto store = [](const Aabb& b, RTCBounds* out) {
            *out = {b.lo.x, b.lo.y, b.lo.z, 0, b.hi.x, b.hi.y, b.hi.z, 0};
        };
        store(parts.left, left);
        store(parts.right, right);
    }

    [[nodiscard]] Bvh assemble(const MeshView& mesh, const std::vector<BvhNode>& nodes,
                               const std::vector<std::uint32_t>& order, std::uint32_t depth) const {
        Bvh bvh;
        const BvhInternals access{bvh};
        access.nodes().reset(nodes.size());
        std::copy(nodes.begin(), nodes.end(), access.nodes().data());
        access.order().reset(order.size());
        std::copy(order.begin(), order.end(), access.order().data());
        access.triangles().reset(order.size());
        for (std::size_t k = 0; k < order.size(); ++k) {
            const Triangle& t = mesh.triangles[order[k]];
            access.triangles()[k] = {without_negative_zero(mesh.vertices[t[0]]),
                                     without_negative_zero(mesh.vertices[t[1]]),
                                     without_negative_zero(mesh.vertices[t[2]])};
        }
        // No radix tree; primitives may be in several leaves.
        access.options().builder =
            quality_ == RTC_BUILD_QUALITY_HIGH ? Builder::sbvh : Builder::ploc;
        access.options().max_leaf = max_leaf_;
        access.inner_count() = static_cast<std::uint32_t>(nodes.size() / 2 - 1);
        access.max_depth() = depth;
        access.input_count() = mesh.triangles.size();
        return bvh;
    }

    MeshView mesh_;
    int max_leaf_;
    RTCBuildQuality quality_;
    RTCDevice device_;
    RTCBVH bvh_;
    std::vector<RTCBuildPrimitive> primitives_, work_;
    Node* root_ = nullptr;
};

}  // namespace raydix::bench
