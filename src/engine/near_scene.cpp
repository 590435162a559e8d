#include "engine/near_scene.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

#include "base/mirrors.h"
#include "engine/hit_points.h"
#include "engine/part_tree.h"
#include "exec/parallel.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

/// A box around the image of `box`, larger by more than corners move that are rounded in the world.
Aabb box_of_image(const Affine& a, const Aabb& box) {
    const Double3 middle = (Double3(box.lo) + Double3(box.hi)) * 0.5,
                  half = (Double3(box.hi) - Double3(box.lo)) * 0.5;
    const Double3 center = a.point(middle);
    const auto reach = [&](Double3 row) {
        return std::fabs(row.x) * half.x + std::fabs(row.y) * half.y + std::fabs(row.z) * half.z;
    };
    const auto pad = [&](Double3 row, double moved) {
        const auto largest = [](double lo, double hi) {
            return std::max(std::fabs(lo), std::fabs(hi));
        };
        return 0x1p-20 * (std::fabs(row.x) * largest(box.lo.x, box.hi.x) +
                          std::fabs(row.y) * largest(box.lo.y, box.hi.y) +
                          std::fabs(row.z) * largest(box.lo.z, box.hi.z) + std::fabs(moved)) +
               double(min_diagonal);
    };
    const Double3 by{reach(a.x) + pad(a.x, a.move.x), reach(a.y) + pad(a.y, a.move.y),
                     reach(a.z) + pad(a.z, a.move.z)};
    return {(center - by).rounded(), (center + by).rounded()};
}

const MeshName& name_of(const std::vector<MeshName>& names, std::uint32_t id) {
    return *std::ranges::lower_bound(names, id, {}, &MeshName::id);
}

TriangleSource source_of(const MeshView& mesh) {
    return {mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
}

/// Triangles without area in [begin, end) of a mesh, that are counted from `first` on.
void list_flat(const TriangleSource& source, std::size_t begin, std::size_t end,
               std::vector<std::uint32_t>& found) {
    Aabb box;
    for (std::size_t i = begin; i < end; ++i) {
        const auto prim = static_cast<std::uint32_t>(i);
        if (source.box(prim, box) && has_zero_area(source.corners(prim))) found.push_back(prim);
    }
}

std::vector<std::uint32_t> flat_of(const MeshView& mesh) {
    constexpr std::size_t block = 1 << 14;
    const std::size_t n = mesh.triangles.size();
    std::vector<std::vector<std::uint32_t>> parts((n + block - 1) / block);
    for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        list_flat(source_of(mesh), begin, end, parts[b]);
    });
    std::vector<std::uint32_t> all;
    for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

/// Each leaf gets a block of its own.
void fill_blocks(std::span<const LeafTriangle> triangles, std::span<const std::uint32_t> prims,
                 FlatTriangles& tree) {
    std::uint32_t leaves = 0;
    const auto for_each_leaf = [&](const auto& visit) {
        for (std::size_t w = 0; w < tree.arrays.nodes.size(); ++w)
            for (std::uint32_t& word : tree.arrays.nodes[w].child)
                if (word != wide_no_child && (word & wide_leaf_bit) != 0) visit(word);
    };
    for_each_leaf([&](std::uint32_t&) { ++leaves; });
    tree.blocks.reset(leaves);
    std::fill_n(tree.blocks.data(), leaves, TriangleBlock{});
    std::uint32_t block = 0;
    for_each_leaf([&](std::uint32_t& word) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        for (std::uint32_t k = 0; k < count; ++k) {
            const std::uint32_t i = tree.part[place + k];
            tree.blocks[block].set(k, triangles[i], prims[i]);
        }
        word = wide_leaf_bit | block * block_lanes << 3 | (count - 1);
        ++block;
    });
    tree.view.blocks = tree.blocks.data();
}

std::shared_ptr<const FlatTriangles> make_flats(const MeshTree& mesh,
                                                const std::vector<MeshName>& names) {
    std::vector<LeafTriangle> triangles;
    std::vector<std::uint32_t> prims;
    for (std::size_t m = 0; m < mesh.ids.size(); ++m) {
        const MeshView& view = name_of(names, mesh.ids[m]).mesh;
        for (const std::uint32_t prim : flat_of(view)) {
            triangles.push_back(source_of(view).corners(prim));
            prims.push_back(mesh.first[m] + prim);
        }
    }
    if (prims.empty()) return nullptr;
    std::vector<Aabb> boxes;
    for (const LeafTriangle& t : triangles) boxes.push_back(box_of(t.v0, t.v1, t.v2));
    auto tree = std::make_shared<FlatTriangles>();
    build_box_tree(boxes, build_options_for(Quality::balanced),
                   {.width = quantised_width, .max_leaf = block_lanes, .block = block_lanes},
                   *tree);
    fill_blocks(triangles, prims, *tree);
    return tree;
}

class NearSceneMaker {
public:
    NearSceneMaker(const SceneTree& scene, NearScene& out) : scene_(scene), out_(out) {}

    void run() {
        if (!scene_.extent.empty()) out_.reach = largest_coordinate(scene_.extent.box);
        flat_boxes_.resize(scene_.own_part_count() + scene_.placed.size());
        for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
            const FlatTriangles* const flats =
                flat_triangles_of(*scene_.meshes[m], scene_.mesh_names);
            // Builders leave out what is smaller than they count.
            const Vec3 side{min_diagonal, min_diagonal, min_diagonal};
            if (flats != nullptr)
                flat_boxes_[m].box = {flats->arrays.bounds.lo - side,
                                      flats->arrays.bounds.hi + side};
        }
        add_ways();
        build_flats();
        look_for_shapes();
    }

private:
    void add_ways() {
        const InstanceName* way[Scene::max_levels];
        out_.ways.resize(scene_.placed.size());
        for (std::size_t k = 0; k < scene_.placed.size(); ++k) {
            const PlacedScene& placed = scene_.placed[k];
            const NearScene& inner = near_scene_of(*placed.scene);
            const std::uint32_t levels = follow_path(scene_, placed.number, way);
            NearWay& near = out_.ways[k];
            near = way_within(inner.reach, static_cast<std::uint32_t>(out_.maps.size()), levels);
            for (std::uint32_t level = levels; level-- > 0;) {
                const Affine map = affine_of(way[level]->transform);
                out_.maps.push_back(map);
                near = placed_by(map, near);
            }
            out_.reach = std::max(out_.reach, near.size);
            if (inner.has_flats())
                flat_boxes_[scene_.own_part_count() + k].box =
                    box_of_image(near.map, inner.flats.arrays.bounds);
        }
    }

    void build_flats() {
        std::vector<std::uint32_t> parts;
        for (std::uint32_t part = 0; part < flat_boxes_.size(); ++part)
            if (!flat_boxes_[part].empty()) parts.push_back(part);
        build_part_tree(parts, flat_boxes_, Quality::balanced, out_.flats);
        for (const std::uint32_t part : parts)
            out_.reach = std::max(out_.reach, largest_coordinate(flat_boxes_[part].box));
    }

    void look_for_shapes() {
        for (const auto& shapes : scene_.shapes) {
            if (shapes->empty()) continue;
            out_.has_shapes = true;
            out_.has_user_geometry |= shapes->user() != nullptr;
        }
        for (const InstanceName& instance : scene_.instances) {
            const NearScene& inner = near_scene_of(*instance.scene);
            out_.has_shapes |= inner.has_shapes;
            out_.has_user_geometry |= inner.has_user_geometry;
        }
    }

    const SceneTree& scene_;
    NearScene& out_;                  // stays where it is: views of its tree point into it
    std::vector<Extent> flat_boxes_;  // [parts]
};

}  // namespace

const FlatTriangles* flat_triangles_of(const MeshTree& mesh, const std::vector<MeshName>& names) {
    std::call_once(mesh.flats->asked, [&] { mesh.flats->known = make_flats(mesh, names); });
    return mesh.flats->known.get();
}

void set_weights(NearWay& way) {
    const Affine& a = way.map;
    const Double3 x{a.x.x, a.y.x, a.z.x}, y{a.x.y, a.y.y, a.z.y}, z{a.x.z, a.y.z, a.z.z};
    const double xx = dot(x, x), yy = dot(y, y), zz = dot(z, z);
    // The least eigenvalue of the columns' cosines, 1 + the least root of m^3 - p m - q.
    const double xy = dot(x, y) / std::sqrt(xx * yy), yz = dot(y, z) / std::sqrt(yy * zz),
                 zx = dot(z, x) / std::sqrt(zz * xx);
    const double p = xy * xy + yz * yz + zx * zx, third = p / 3;
    double least = -std::sqrt(p);  // of a symmetric matrix with this trace of its square
    if (p > 1e-14) {
        const double angle =
            std::acos(std::clamp(xy * yz * zx / (third * std::sqrt(third)), -1.0, 1.0));
        least = std::min(0.0, 2 * std::sqrt(third) * std::cos((angle + 2 * std::numbers::pi) / 3));
    }
    const double part = std::max(0.0, 1 + least - 0x1p-20);
    const auto weight = [&](double square) {
        const double w = part * square;
        return !(w > 1e-37) ? 0.0f : static_cast<float>(std::min(w, 1e37));
    };
    way.weight[0] = weight(xx), way.weight[1] = weight(yy), way.weight[2] = weight(zz);
}

NearWay compose(const NearWay& outer, const NearWay& inner) {
    const auto product = [](const Affine& a, const Affine& b) -> Affine {
        const auto row = [&](Double3 r) { return b.x * r.x + b.y * r.y + b.z * r.z; };
        return {row(a.x), row(a.y), row(a.z), a.point(b.move)};
    };
    const Double3 move = outer.map.move;
    NearWay out{product(outer.map, inner.map),
                product(inner.inverse, outer.inverse),
                {},
                norm_of(outer.map) * inner.size +
                    std::max({std::fabs(move.x), std::fabs(move.y), std::fabs(move.z)}),
                inner.first,
                inner.count,
                outer.mirrors != inner.mirrors};
    set_weights(out);
    return out;
}

NearWay placed_by(const Affine& map, const NearWay& inner) {
    const bool turned = mirrors(map.x, map.y, map.z);
    return compose({map, *inverse_of(map), {}, 0, inner.first, inner.count, turned}, inner);
}

NearWay way_within(double reach, std::uint32_t first, std::uint32_t count) {
    const Affine none{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
    return {none, none, {}, reach, first, count};
}

const NearScene& near_scene_of(const SceneTree& scene) {
    // A thread that waits for loops in it must not take up another query of the same scene.
    std::call_once(scene.later->near_asked, [&] {
        isolated([&] {
            auto near = std::make_shared<NearScene>();
            NearSceneMaker(scene, *near).run();
            scene.later->near = std::move(near);
        });
    });
    return *scene.later->near;
}

}  // namespace raydix
