// What stands behind the handles of raydix_c.h and raydix_c_double.h, and how exceptions become
// statuses.
#pragma once

#include <raydix/raydix.h>
#include <raydix_c.h>
#include <raydix_c_double.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <span>
#include <string>

struct raydix_scene {
    raydix::Scene scene;
};
struct raydix_scene_d {
    raydix::SceneD scene;
};
struct raydix_hit_lists {
    raydix::AllHits lists;
};
struct raydix_hit_lists_d {
    raydix::AllHitsD lists;
};
struct raydix_solid {
    raydix::Solid solid;
};
struct raydix_solid_d {
    raydix::SolidD solid;
};
struct raydix_points {
    raydix::Points index;
};
struct raydix_points_d {
    raydix::PointsD index;
};
struct raydix_lists {
    raydix::PointLists<float> lists;
};
struct raydix_lists_d {
    raydix::PointLists<double> lists;
};

namespace raydix_c {

/// The status of the exception that is being handled; keeps its message for this thread.
raydix_status status_of_exception() noexcept;

/// Runs the body of a call.
template <class Body>
raydix_status guarded(const Body& body) noexcept {
    try {
        body();
        return RAYDIX_OK;
    } catch (...) {
        return status_of_exception();
    }
}

/// Throws InputError that names the argument unless it is there.
inline void require(const void* argument, const char* name) {
    if (argument == nullptr) throw raydix::InputError(std::string(name) + " is NULL");
}

/// Throws InputError unless an array of `count` elements can exist.
inline void require_countable(std::size_t count, std::size_t element_bytes, const char* name) {
    if (count > PTRDIFF_MAX / element_bytes)
        throw raydix::InputError(std::string(name) + ": " + std::to_string(count) +
                                 " elements are more than an array can have");
}

/// `count` things of type T at a caller's array, whose elements have the same layout.
template <class T, class Element>
std::span<const T> array_of(const Element* first, std::size_t count, const char* name) {
    static_assert(sizeof(T) % sizeof(Element) == 0 && alignof(T) == alignof(Element));
    if (count > 0) require(first, name);
    require_countable(count, sizeof(T), name);
    return {reinterpret_cast<const T*>(first), count};
}
template <class T, class Element>
std::span<T> results_at(Element* first, std::size_t count, const char* name) {
    static_assert(sizeof(T) % sizeof(Element) == 0 && alignof(T) == alignof(Element));
    if (count > 0) require(first, name);
    require_countable(count, sizeof(T), name);
    return {reinterpret_cast<T*>(first), count};
}

/// Whether the last field ends where the struct does: a field that comes later then makes the
/// struct larger, and struct_size tells it.
#define RAYDIX_HAS_NO_TAIL(Options, last) \
    (offsetof(Options, last) + sizeof(Options::last) == sizeof(Options))
static_assert(RAYDIX_HAS_NO_TAIL(raydix_commit_options, reserved));
static_assert(RAYDIX_HAS_NO_TAIL(raydix_trace_options, max_result_bytes));
static_assert(RAYDIX_HAS_NO_TAIL(raydix_trace_options_d, max_result_bytes));
static_assert(RAYDIX_HAS_NO_TAIL(raydix_closest_options, reserved));
static_assert(RAYDIX_HAS_NO_TAIL(raydix_closest_options_d, threads));
#undef RAYDIX_HAS_NO_TAIL

/// A caller's options over the defaults: as many bytes as the caller's version of the struct has.
template <class Options>
Options options_over(const Options* given, Options defaults) {
    if (given == nullptr) return defaults;
    if (given->struct_size < sizeof(std::size_t) || given->struct_size > sizeof(Options))
        throw raydix::InputError("struct_size of the options is " +
                                 std::to_string(given->struct_size) + "; this version knows " +
                                 std::to_string(sizeof(std::size_t)) + " to " +
                                 std::to_string(sizeof(Options)));
    std::memcpy(static_cast<void*>(&defaults), given, given->struct_size);
    if constexpr (requires { defaults.reserved; })
        if (defaults.reserved != 0)
            throw raydix::InputError("reserved of the options is " +
                                     std::to_string(defaults.reserved) +
                                     "; this version takes 0 alone");
    return defaults;
}

}  // namespace raydix_c
