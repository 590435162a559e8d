// What the vertices of a mesh carry beside their places: numbers by name, which hits are given.
#pragma once

#include <raydix/types.h>

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace raydix::python {

/// A value for each vertex, or a row of them.
template <class Scalar>
struct Attribute {
    std::vector<Scalar> values;
    std::optional<std::size_t> columns;  // none: an array of one dimension
};

/// Those of one mesh. A commit that has the mesh shares them, so what is set later shows at once;
/// another mesh gets a copy. Scenes that show each other have locks of their own, hence this one.
template <class Scalar>
class Attributes {
public:
    using Value = std::shared_ptr<const Attribute<Scalar>>;
    using Triangles = std::shared_ptr<const std::vector<Triangle>>;

    struct Found {
        Value value;
        std::size_t vertices;  // that the mesh has
        Triangles triangles;
    };

    /// A copy for a mesh with so many vertices.
    [[nodiscard]] std::shared_ptr<Attributes> of(std::size_t vertices, Triangles triangles) const {
        auto copy = std::make_shared<Attributes>();
        copy->by_name_ = all();
        copy->vertices_ = vertices;
        copy->triangles_ = std::move(triangles);
        return copy;
    }
    /// The mesh is known from now on, which may have been in a file. A null value takes it away.
    void set(const std::string& name, Value value, std::size_t vertices, Triangles triangles) {
        const std::lock_guard lock(mutex_);
        vertices_ = vertices;
        triangles_ = std::move(triangles);
        if (value == nullptr)
            by_name_.erase(name);
        else
            by_name_[name] = std::move(value);
    }
    [[nodiscard]] std::optional<Found> find(const std::string& name) const {
        const std::lock_guard lock(mutex_);
        const auto found = by_name_.find(name);
        if (found == by_name_.end()) return std::nullopt;
        return Found{found->second, vertices_, triangles_};
    }
    [[nodiscard]] std::map<std::string, Value> all() const {
        const std::lock_guard lock(mutex_);
        return by_name_;
    }

private:
    mutable std::mutex mutex_;
    std::map<std::string, Value> by_name_;
    std::size_t vertices_ = 0;
    Triangles triangles_;
};

}  // namespace raydix::python
