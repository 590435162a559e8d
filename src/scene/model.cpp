// A model's meshes and nodes -> one mesh.
#include <raydix/error.h>
#include <raydix/model.h>

#include <span>
#include <utility>

#include "base/float_env.h"
#include "exec/join_copies.h"
#include "scene/byte_source.h"
#include "scene/mesh_builder.h"
#include "scene/model_nodes.h"

namespace raydix {
namespace {

/// Copies of a model's meshes, behind each other.
class Flattening {
public:
    explicit Flattening(const Model& model) : model_(model), ways_(model) {
        if (model.nodes.empty()) {
            for (std::size_t i = 0; i < model.meshes.size(); ++i) plan(i, NodeWays::world);
            return;
        }
        for (std::uint32_t k = 0; k < model.nodes.size(); ++k)
            for (std::uint32_t i = 0; i < model.nodes[k].mesh_count; ++i)
                plan(model.nodes[k].first_mesh + i, k);
    }

    [[nodiscard]] Mesh run() const {
        check_size();
        Mesh out;
        join_copies(std::span<const Copy>(copies_), vertices_, triangles_, out);
        return out;
    }

private:
    struct Copy {
        MeshView mesh;
        const NodeWays* ways;
        std::uint32_t node;
        std::uint64_t first_vertex, first_triangle;

        [[nodiscard]] bool mirrors() const { return ways->mirrors(node); }
        [[nodiscard]] auto mover() const {
            return [this](Vec3 vertex) { return ways->moved(node, vertex); };
        }
    };

    void plan(std::size_t mesh, std::uint32_t node) {
        const Mesh& source = model_.meshes.at(mesh);
        copies_.push_back({source, &ways_, node, vertices_, triangles_});
        vertices_ += source.vertices.size();
        triangles_ += source.triangles.size();
    }

    static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t triangles) {
        return vertices * sizeof(Vec3) + triangles * sizeof(Triangle);
    }

    void check_size() const {
        std::uint64_t own = 0;
        for (const Mesh& mesh : model_.meshes)
            own += bytes(mesh.vertices.size(), mesh.triangles.size());
        const char* fault = nullptr;
        if (bytes(vertices_, triangles_) > expansion_limit(own))
            fault = "its copies take more than 1000 times the memory of the meshes";
        else if (vertices_ > max_vertices)
            fault = "more than 2^32 - 1 vertices";
        else if (triangles_ > max_triangles)
            fault = "more than 2^31 - 1 triangles";
        if (fault != nullptr) throw InputError(model_.name + ": as one mesh: " + fault);
    }

    const Model& model_;
    const NodeWays ways_;
    std::vector<Copy> copies_;
    std::uint64_t vertices_ = 0, triangles_ = 0;
};

void require_flat(const Model& model) {
    if (!model.is_flat())
        throw InputError(model.name + ": it has " + std::to_string(model.meshes.size()) +
                         " meshes in " + std::to_string(model.nodes.size()) +
                         " nodes where one mesh is wanted: flatten it, or trace a Scene of it");
}

}  // namespace

const Mesh& Model::mesh() const& {
    static const Mesh none;
    require_flat(*this);
    return meshes.empty() ? none : meshes.front();
}

Mesh& Model::mesh() & {
    require_flat(*this);
    if (meshes.empty()) meshes.emplace_back();
    return meshes.front();
}

Mesh Model::mesh() && { return std::move(mesh()); }

void Model::flatten() {
    if (is_flat()) return;
    const FloatEnvironment exact;
    std::vector<Mesh> all(1);
    all.front() = Flattening(*this).run();
    all.front().name = name;
    meshes = std::move(all);
    nodes.clear();
}

}  // namespace raydix
