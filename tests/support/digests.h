// Digests of answers: sixteen digits that tests keep in place of thousands of hits, so that a bit
// that changes is noticed, whatever calls the answer came from.
#pragma once

#include <raydix/double.h>
#include <raydix/mesh.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace raydix::test {

/// Numbers one behind another, little-endian and without padding: what a digest is of never depends
/// on the layout of a struct.
class Packed {
public:
    template <class Number>
    requires std::is_arithmetic_v<Number> Packed& add(Number number) {
        return append(&number, sizeof(number));
    }
    Packed& add(Vec3 p) { return add(p.x).add(p.y).add(p.z); }
    Packed& add(Vec3d p) { return add(p.x).add(p.y).add(p.z); }
    Packed& add(const Ray& r) { return add(r.origin).add(r.tmin).add(r.direction).add(r.tmax); }
    Packed& add(const RayD& r) { return add(r.origin).add(r.tmin).add(r.direction).add(r.tmax); }
    Packed& add(const Triangle& t) { return add(t[0]).add(t[1]).add(t[2]); }
    Packed& add(const Mesh& mesh) { return add_all(mesh.vertices).add_all(mesh.triangles); }
    Packed& add(const MeshD& mesh) { return add_all(mesh.vertices).add_all(mesh.triangles); }
    template <class Values>
    Packed& add_all(const Values& values) {
        for (const auto& value : values) add(value);
        return *this;
    }
    /// t, prim, u, v, of any hit that has these.
    template <class AnyHit>
    Packed& add_hit(const AnyHit& hit) {
        return add(hit.t).add(hit.prim).add(hit.u).add(hit.v);
    }

    /// XXH3 with 64 bits as hex; "-" of nothing.
    [[nodiscard]] std::string digest() const;

private:
    Packed& append(const void* bytes, std::size_t size);
    std::vector<unsigned char> bytes_;
};

/// What came out of one way to ask. `where` is apart, so that hits in one scene of meshes and of
/// instances have the same digest: geometry and instance ids, or where each query's answers begin.
struct Answer {
    Packed values, where;
    std::size_t found = 0;  // queries, or hits of lists: for the check that the question asks much
};

/// One way through the API to the same answer.
struct Way {
    std::string name;
    std::function<Answer()> answer;
};

/// A question: what goes in, and all ways to ask it.
struct Question {
    Packed input;
    std::size_t least_found = 1;
    std::vector<Way> ways;
};

/// A row of a table of digests. Where one differs, the first column that differs says which step
/// did it.
struct Known {
    const char *scene, *query;
    const char *input, *values, *where;
};

/// The row's name in the list of tests.
std::string name_of(const Known& known);
void PrintTo(const Known& known, std::ostream* out);

/// Asks in all ways, under sanitizers and emulation in every third, and expects the row's digests
/// of each. If all agree on others, the new row is printed as it would stand in the table.
void expect_known(const Known& known, const Question& question);

}  // namespace raydix::test
