// glTF 2.0 scene -> a model: primitives in document order, and the nodes that place them.
// Triangles, strips and fans; points give vertices; lines give nothing.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "scene/gltf_document.h"
#include "scene/json_input.h"
#include "scene/mesh_builder.h"

namespace raydix {

using nlohmann::json;

namespace {

class SceneWalk {
public:
    explicit SceneWalk(GltfDocument& document) : document_(document), in_(document.source()) {}

    Model read() {
        number_primitives();
        struct Visit {
            std::uint64_t node;
            std::uint32_t parent;
        };
        std::vector<Visit> todo;
        const auto push = [&](const std::vector<std::uint64_t>& nodes, std::uint32_t parent) {
            for (auto node = nodes.rbegin(); node != nodes.rend(); ++node)
                todo.push_back({*node, parent});
        };
        std::vector<bool> visited(static_cast<std::size_t>(document_.list_size("nodes")));
        push(root_nodes(), ModelNode::none);
        while (!todo.empty()) {
            const Visit visit = todo.back();
            todo.pop_back();
            const json& node = document_.item("nodes", visit.node);
            if (visited[static_cast<std::size_t>(visit.node)])
                document_.fail("nodes", visit.node, "is reached twice");
            visited[static_cast<std::size_t>(visit.node)] = true;
            const auto place = static_cast<std::uint32_t>(model_.nodes.size());
            add_node(visit.node, node, visit.parent);
            push(node_list(node, "children", fmt::format("nodes {}", visit.node)), place);
        }
        drop_plain_node();
        return std::move(model_);
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

    [[nodiscard]] TransformD node_transform(std::uint64_t node) const {
        TransformD transform;
        if (document_.item("nodes", node).contains("matrix")) {
            const auto m = numbers<16>(node, "matrix", {});
            for (std::size_t c = 0; c < 4; ++c)
                for (std::size_t r = 0; r < 3; ++r) transform.m[r][c] = m[4 * c + r];
            return transform;
        }
        const auto [x, y, z, w] = numbers<4>(node, "rotation", {0, 0, 0, 1});
        const auto scale = numbers<3>(node, "scale", {1, 1, 1});
        const auto move = numbers<3>(node, "translation", {0, 0, 0});
        transform.m = {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                        {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                        {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}};
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 3; ++c) transform.m[r][c] *= scale[c];
            transform.m[r][3] = move[r];
        }
        return transform;
    }

    /// Room for the primitives of all meshes, those that no node shows included: their places are
    /// their ids.
    void number_primitives() {
        const std::uint64_t meshes = document_.list_size("meshes");
        std::uint64_t count = 0;
        for (std::uint64_t mesh = 0; mesh < meshes; ++mesh) {
            first_primitive_.push_back(static_cast<std::uint32_t>(count));
            const json& entry = document_.item("meshes", mesh);
            const auto primitives = entry.find("primitives");
            if (primitives != entry.end() && primitives->is_array()) count += primitives->size();
        }
        loaded_.resize(static_cast<std::size_t>(meshes));
        model_.meshes.resize(static_cast<std::size_t>(count));
    }

    void add_node(std::uint64_t index, const json& node, std::uint32_t parent) {
        ModelNode place;
        place.parent = parent;
        place.transform = node_transform(index);
        const auto name = node.find("name");
        if (name != node.end() && name->is_string()) place.name = name->get<std::string>();
        if (const auto mesh = find_whole(in_, node, "mesh", fmt::format("nodes {}", index))) {
            place.mesh_count = load_mesh(*mesh);
            place.first_mesh = first_primitive_[static_cast<std::size_t>(*mesh)];
        }
        model_.nodes.push_back(std::move(place));
    }

    /// One mesh that stands where it is needs no node.
    void drop_plain_node() {
        if (model_.nodes.size() == 1 && model_.meshes.size() == 1 &&
            model_.nodes[0].mesh_count == 1 && model_.nodes[0].transform.m == TransformD{}.m)
            model_.nodes.clear();
    }

    /// Reads the primitives of a mesh once. Returns how many it has.
    std::uint32_t load_mesh(std::uint64_t mesh) {
        const json& entry = document_.item("meshes", mesh);
        const auto primitives = entry.find("primitives");
        if (primitives == entry.end() || !primitives->is_array())
            document_.fail("meshes", mesh, "has no list of primitives");
        const auto count = static_cast<std::uint32_t>(primitives->size());
        if (loaded_[static_cast<std::size_t>(mesh)]) return count;
        loaded_[static_cast<std::size_t>(mesh)] = true;
        count_users(*primitives);
        positions_.clear();
        std::uint32_t place = first_primitive_[static_cast<std::size_t>(mesh)];
        for (const json& primitive : *primitives) {
            if (!primitive.is_object())
                document_.fail("meshes", mesh, "a primitive is not an object");
            add_primitive(mesh, primitive, model_.meshes[place]);
            check_growth(mesh, model_.meshes[place]);
            ++place;
        }
        return count;
    }

    /// How many primitives name each accessor of positions.
    void count_users(const json& primitives) {
        users_.clear();
        for (const json& primitive : primitives) {
            if (!primitive.is_object()) continue;
            const auto attributes = primitive.find("attributes");
            if (attributes == primitive.end() || !attributes->is_object()) continue;
            const auto position = attributes->find("POSITION");
            if (position != attributes->end() && position->is_number_unsigned())
                ++users_[position->get<std::uint64_t>()];
        }
    }

    void add_primitive(std::uint64_t mesh, const json& primitive, Mesh& out) {
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
        const std::vector<Vec3>& vertices = positions_of(*position);
        if (mode == points) {
            out.vertices = vertices;
            return;
        }
        std::vector<std::uint32_t> order;
        if (const auto accessor = find_whole(in_, primitive, "indices", element)) {
            order = document_.indices(*accessor);
        } else {
            order.resize(vertices.size());
            std::iota(order.begin(), order.end(), 0u);
        }
        for (const std::uint32_t index : order)
            if (index >= vertices.size())
                in_.fail(element, fmt::format("index {} of {} vertices", index, vertices.size()));
        if (users_[*position] > 1)
            keep_used(vertices, order, out.vertices);
        else
            out.vertices = vertices;
        add_triangles(element, mode, order, out);
    }

    /// Primitives of one mesh often share their positions.
    const std::vector<Vec3>& positions_of(std::uint64_t accessor) {
        const auto found = positions_.find(accessor);
        if (found != positions_.end()) return found->second;
        std::vector<Vec3> points = document_.positions(accessor);
        check_mesh_size(in_, points.size(), 0);
        for (Vec3& p : points) p = without_negative_zero(p);
        return positions_.emplace(accessor, std::move(points)).first->second;
    }

    /// The vertices that `order` names, in their order; `order` then names places among these.
    static void keep_used(const std::vector<Vec3>& vertices, std::vector<std::uint32_t>& order,
                          std::vector<Vec3>& used) {
        std::vector<std::uint32_t> names(order);
        std::sort(names.begin(), names.end());
        names.erase(std::unique(names.begin(), names.end()), names.end());
        used.reserve(names.size());
        for (const std::uint32_t name : names) used.push_back(vertices[name]);
        for (std::uint32_t& index : order)
            index = static_cast<std::uint32_t>(std::lower_bound(names.begin(), names.end(), index) -
                                               names.begin());
    }

    void add_triangles(const std::string& element, std::uint64_t mode,
                       const std::vector<std::uint32_t>& order, Mesh& out) {
        constexpr std::uint64_t triangles = 4, strip = 5;
        if (mode == triangles && order.size() % 3 != 0)
            in_.fail(element, fmt::format("{} indices are not whole triangles", order.size()));
        const std::size_t step = mode == triangles ? 3 : 1;
        for (std::size_t i = 0; i + 2 < order.size(); i += step) {
            const std::size_t odd = mode == strip ? i % 2 : 0;
            Triangle triangle{order[i], order[i + 1 + odd], order[i + 2 - odd]};
            if (mode > strip) triangle = {order[i + 1], order[i + 2], order[0]};
            add_triangle(in_, out, triangle);
        }
    }

    /// Many primitives may name the same bytes; the whole must stay in proportion to the file
    /// nevertheless.
    void check_growth(std::uint64_t mesh, const Mesh& added) {
        held_ += added.vertices.size() * sizeof(Vec3) + added.triangles.size() * sizeof(Triangle);
        if (held_ > expansion_limit(document_.bytes()))
            document_.fail("meshes", mesh,
                           "its copies take more than 1000 times the size of the file");
    }

    GltfDocument& document_;
    const ByteSource& in_;
    Model model_;
    std::uint64_t held_ = 0;                      // bytes of the meshes
    std::vector<std::uint32_t> first_primitive_;  // [meshes of the document]
    std::vector<bool> loaded_;                    // [meshes of the document]
    // Of the current mesh, by accessor.
    std::map<std::uint64_t, std::vector<Vec3>> positions_;
    std::map<std::uint64_t, std::uint32_t> users_;
};

}  // namespace

Model load_gltf(ByteSource& in, const OpenExternal& open_external) {
    GltfDocument document(in, open_external);
    return SceneWalk(document).read();
}

std::vector<std::filesystem::path> gltf_external_files(ByteSource& in) {
    return GltfDocument(in, {}).external_files();
}

}  // namespace raydix
