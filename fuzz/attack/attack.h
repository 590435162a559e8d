// A kind of attack is a function that makes one case from a seed, asks the library and an
// independent reference, and tells the tally what differs.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "attack/meshes.h"
#include "attack/random.h"
#include "attack/tally.h"

namespace raydix::attack {

/// One case while it runs.
class Case {
public:
    Case(std::string_view kind, std::uint64_t seed, std::uint64_t index, Tally& tally)
        : random(case_seed(seed, kind, index)),
          kind_(kind),
          seed_(seed),
          index_(index),
          tally_(tally) {}

    Random random;

    [[nodiscard]] std::string_view kind() const { return kind_; }
    [[nodiscard]] std::uint64_t index() const { return index_; }
    [[nodiscard]] Tally& tally() { return tally_; }
    void compared(std::string_view group, std::uint64_t answers) {
        tally_.compared(group, answers);
    }
    /// Whether a reproducer of this sort is still wanted: making one takes time.
    [[nodiscard]] bool wants(std::string_view what) const {
        return tally_.seen(kind_, what) < Tally::kept;
    }
    void found(std::string_view what, std::string reproducer) {
        tally_.found({std::string(kind_), std::string(what), seed_, index_, std::move(reproducer)});
    }
    /// Counts one answer of `group`, and a finding unless it is right.
    void expect(bool right, std::string_view group, std::string_view what,
                const std::function<std::string()>& reproducer = {}) {
        compared(group, 1);
        if (!right) found(what, wants(what) && reproducer ? reproducer() : std::string());
    }

private:
    std::string_view kind_;
    std::uint64_t seed_, index_;
    Tally& tally_;
};

/// Set by --planted: the kind `rays` then spoils one answer of the library a case, and must find
/// it.
inline bool planted_fault = false;

/// A kind of case. One file of this folder makes one, which enters the list of all by itself: a
/// build that leaves the file out has one kind less.
struct Kind {
    Kind(const char* its_name, void (*its_run)(Case&), double its_weight);

    const char* name;
    void (*run)(Case&);
    double weight;  // its share of the time
};
/// By name.
std::vector<Kind> all_kinds();

/// All builders with random other options of any value; one thread, or now and then some.
std::vector<BuildOptions> every_builder(Random& random);
BuildOptions any_build_options(Random& random);

/// Drops triangles while `fails` holds; at most some hundred calls.
Mesh minimise(const Mesh& mesh, const std::function<bool(const Mesh&)>& fails);

std::string text_of(const BuildOptions& options);
std::string text_of(Vec3 p);
std::string text_of(Vec3d p);
std::string text_of(const Ray& ray);
std::string text_of(const RayD& ray);
std::string text_of(const TreeHit& hit);
std::string text_of(const TreeHitD& hit);
/// Up to eight triangles, then how many more there are.
std::string text_of(const Mesh& mesh);
std::string text_of(const MeshD& mesh);
/// As std::printf into a string.
std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// Byte for byte.
template <class T>
bool same_bytes(std::span<const T> a, std::span<const T> b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}
template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
    return same_bytes(std::span<const T>(a), std::span<const T>(b));
}

}  // namespace raydix::attack
