// glTF 2.0 scene -> one mesh: node by node in document order, each primitive with its node's
// transform. Triangles, strips and fans; points give vertices; lines give nothing.
#include <fmt/format.h>

#include <array>
#include <numeric>

#include "scene/gltf_document.h"
#include "scene/json_input.h"
#include "scene/mesh_builder.h"

namespace raydix {

using nlohmann::json;

namespace {

/// Columns of the linear part, then the translation.
struct Affine {
    std::array<std::array<double, 3>, 4> columns{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};

    friend bool operator==(const Affine&, const Affine&) = default;

    [[nodiscard]] std::array<double, 3> apply(double x, double y, double z, double w) const {
        std::array<double, 3> out;
        for (std::size_t r = 0; r < 3; ++r)
            out[r] = columns[0][r] * x + columns[1][r] * y + columns[2][r] * z + columns[3][r] * w;
        return out;
    }
    /// this after `inner`
    [[nodiscard]] Affine times(const Affine& inner) const {
        Affine product;
        for (std::size_t c = 0; c < 4; ++c)
            product.columns[c] = apply(inner.columns[c][0], inner.columns[c][1],
                                       inner.columns[c][2], c == 3 ? 1.0 : 0.0);
        return product;
    }
    [[nodiscard]] bool mirrors() const {
        const auto& [a, b, c, origin] = columns;
        return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                   a[2] * (b[0] * c[1] - b[1] * c[0]) <
               0;
    }
};

class SceneWalk {
public:
    explicit SceneWalk(GltfDocument& document) : document_(document), in_(document.source()) {}

    Mesh read() {
        struct Visit {
            std::uint64_t node;
            Affine parent;
        };
        std::vector<Visit> todo;
        const auto push = [&](const std::vector<std::uint64_t>& nodes, const Affine& parent) {
            for (auto node = nodes.rbegin(); node != nodes.rend(); ++node)
                todo.push_back({*node, parent});
        };
        std::vector<bool> visited(static_cast<std::size_t>(document_.list_size("nodes")));
        push(root_nodes(), {});
        while (!todo.empty()) {
            const Visit visit = todo.back();
            todo.pop_back();
            const json& node = document_.item("nodes", visit.node);
            if (visited[static_cast<std::size_t>(visit.node)])
                document_.fail("nodes", visit.node, "is reached twice");
            visited[static_cast<std::size_t>(visit.node)] = true;
            const Affine transform = visit.parent.times(node_transform(visit.node));
            const auto mesh = find_whole(in_, node, "mesh", fmt::format("nodes {}", visit.node));
            if (mesh) add_mesh(*mesh, transform);
            push(node_list(node, "children", fmt::format("nodes {}", visit.node)), transform);
        }
        return std::move(mesh_);
    }

private:
    /// Of the default scene, else of the first one, else all nodes that are nobody's child.
    [[nodiscard]] std::vector<std::uint64_t> root_nodes() const {
        if (document_.list_size("scenes") > 0) {
            const std::uint64_t scene =
                find_whole(in_, document_.root(), "scene", "document").value_or(0);
            return node_list(document_.item("scenes", scene), "nodes",
                             fmt::format("scenes {}", scene));
        }
        const std::uint64_t count = document_.list_size("nodes");
        std::vector<bool> is_child(static_cast<std::size_t>(count));
        for (std::uint64_t i = 0; i < count; ++i)
            for (const std::uint64_t child :
                 node_list(document_.item("nodes", i), "children", fmt::format("nodes {}", i)))
                if (child < count) is_child[static_cast<std::size_t>(child)] = true;
        std::vector<std::uint64_t> roots;
        for (std::uint64_t i = 0; i < count; ++i)
            if (!is_child[static_cast<std::size_t>(i)]) roots.push_back(i);
        return roots;
    }

    [[nodiscard]] std::vector<std::uint64_t> node_list(const json& object, const char* key,
                                                       const std::string& element) const {
        const auto found = object.find(key);
        std::vector<std::uint64_t> nodes;
        if (found == object.end()) return nodes;
        for (const json& entry : *found) {
            if (!found->is_array() || !entry.is_number_unsigned())
                in_.fail(element, fmt::format("{} is not a list of nodes", key));
            nodes.push_back(entry.get<std::uint64_t>());
        }
        return nodes;
    }

    template <std::size_t n>
    [[nodiscard]] std::array<double, n> numbers(std::uint64_t node, const char* key,
                                                std::array<double, n> fallback) const {
        const json& object = document_.item("nodes", node);
        const auto found = object.find(key);
        if (found == object.end()) return fallback;
        const bool fits = found->is_array() && found->size() == n &&
                          std::all_of(found->begin(), found->end(),
                                      [](const json& value) { return value.is_number(); });
        if (!fits)
            document_.fail("nodes", node, fmt::format("{} is not a list of {} numbers", key, n));
        for (std::size_t i = 0; i < n; ++i) fallback[i] = (*found)[i].template get<double>();
        return fallback;
    }

    [[nodiscard]] Affine node_transform(std::uint64_t node) const {
        Affine transform;
        if (document_.item("nodes", node).contains("matrix")) {
            const auto m = numbers<16>(node, "matrix", {});
            for (std::size_t c = 0; c < 4; ++c)
                for (std::size_t r = 0; r < 3; ++r) transform.columns[c][r] = m[4 * c + r];
            return transform;
        }
        const auto [x, y, z, w] = numbers<4>(node, "rotation", {0, 0, 0, 1});
        const auto scale = numbers<3>(node, "scale", {1, 1, 1});
        transform.columns = {{{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
                              {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
                              {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)},
                              numbers<3>(node, "translation", {0, 0, 0})}};
        for (std::size_t c = 0; c < 3; ++c)
            for (double& value : transform.columns[c]) value *= scale[c];
        return transform;
    }

    void add_mesh(std::uint64_t mesh, const Affine& transform) {
        const json& entry = document_.item("meshes", mesh);
        const auto primitives = entry.find("primitives");
        if (primitives == entry.end() || !primitives->is_array())
            document_.fail("meshes", mesh, "has no list of primitives");
        first_vertex_.clear();
        for (const json& primitive : *primitives) {
            if (!primitive.is_object())
                document_.fail("meshes", mesh, "a primitive is not an object");
            add_primitive(mesh, primitive, transform);
            check_growth(mesh);
        }
    }

    void add_primitive(std::uint64_t mesh, const json& primitive, const Affine& transform) {
        const std::string element = fmt::format("meshes {}", mesh);
        constexpr std::uint64_t points = 0, triangles = 4, fan = 6;
        const std::uint64_t mode = find_whole(in_, primitive, "mode", element).value_or(triangles);
        if (mode > fan) in_.fail(element, fmt::format("mode {} is unknown", mode));
        if (mode != points && mode < triangles) return;
        const auto attributes = primitive.find("attributes");
        if (attributes == primitive.end() || !attributes->is_object())
            in_.fail(element, "a primitive without attributes");
        const auto position = find_whole(in_, *attributes, "POSITION", element);
        if (!position) return;  // the specification has readers skip such a primitive
        const VertexRange range = add_positions(*position, transform);
        if (mode == points) return;
        std::vector<std::uint32_t> order(static_cast<std::size_t>(range.count));
        if (const auto accessor = find_whole(in_, primitive, "indices", element))
            order = document_.indices(*accessor);
        else
            std::iota(order.begin(), order.end(), 0u);
        for (std::uint32_t& index : order) {
            if (index >= range.count)
                in_.fail(element, fmt::format("index {} of {} vertices", index, range.count));
            index += range.first;
        }
        add_triangles(element, mode, order, transform.mirrors());
    }

    struct VertexRange {
        std::uint32_t first = 0;
        std::uint64_t count = 0;
    };

    /// Primitives of one mesh often share their positions: these are added once per node.
    VertexRange add_positions(std::uint64_t accessor, const Affine& transform) {
        const auto found = first_vertex_.find(accessor);
        if (found != first_vertex_.end()) return found->second;
        const std::vector<Vec3> points = document_.positions(accessor);
        check_mesh_size(in_, mesh_.vertices.size() + points.size(), 0);
        const VertexRange range{static_cast<std::uint32_t>(mesh_.vertices.size()), points.size()};
        const bool moves =
            transform != Affine{};  // if not, Inf must stay Inf and not become 0 * Inf
        for (const Vec3& p : points) {
            const auto q = transform.apply(double(p.x), double(p.y), double(p.z), 1.0);
            add_vertex(in_, mesh_,
                       moves ? Vec3{static_cast<float>(q[0]), static_cast<float>(q[1]),
                                    static_cast<float>(q[2])}
                             : p);
        }
        first_vertex_.emplace(accessor, range);
        return range;
    }

    /// A mirroring transform would turn the triangles inside out: two corners change places.
    void add_triangles(const std::string& element, std::uint64_t mode,
                       const std::vector<std::uint32_t>& order, bool mirrors) {
        constexpr std::uint64_t triangles = 4, strip = 5;
        if (mode == triangles && order.size() % 3 != 0)
            in_.fail(element, fmt::format("{} indices are not whole triangles", order.size()));
        const std::size_t step = mode == triangles ? 3 : 1;
        for (std::size_t i = 0; i + 2 < order.size(); i += step) {
            const std::size_t odd = mode == strip ? i % 2 : 0;
            Triangle triangle{order[i], order[i + 1 + odd], order[i + 2 - odd]};
            if (mode > strip) triangle = {order[i + 1], order[i + 2], order[0]};
            if (mirrors) std::swap(triangle[1], triangle[2]);
            add_triangle(in_, mesh_, triangle);
        }
    }

    /// Many nodes may show one mesh; the whole must stay in proportion to the file nevertheless.
    void check_growth(std::uint64_t mesh) const {
        const std::uint64_t bytes =
            mesh_.vertices.size() * sizeof(Vec3) + mesh_.triangles.size() * sizeof(Triangle);
        if (bytes > expansion_limit(document_.bytes()))
            document_.fail("meshes", mesh,
                           "its copies take more than 1000 times the size of the file");
    }

    GltfDocument& document_;
    const ByteSource& in_;
    Mesh mesh_;
    std::map<std::uint64_t, VertexRange> first_vertex_;  // of the current node, by accessor
};

}  // namespace

Mesh load_gltf(ByteSource& in, const OpenExternal& open_external) {
    GltfDocument document(in, open_external);
    return SceneWalk(document).read();
}

}  // namespace raydix
