// A moving ball and the triangles of a tree -> the first contact as callers get it, in float and in
// double.
#pragma once

#include <raydix/double.h>
#include <raydix/overlap.h>

#include <type_traits>

#include "proximity/sweep_walk.h"

namespace raydix {

/// The names of what a sweep goes through.
struct FloatSweeps {
    using Tree = SweepTree;
    using Frame = SweepFrame;
    using Hit = SweepHit;
};
struct DoubleSweeps {
    using Tree = PaddedTreeD;
    using Frame = SweepFrameD;
    using Hit = SweepHitD;
};

template <class AnyBvh>
using SweepsOf = std::conditional_t<std::is_same_v<AnyBvh, Bvh>, FloatSweeps, DoubleSweeps>;

/// Without a radius: the watertight test of rays.
template <class Kind, class Stack>
[[nodiscard]] typename Kind::Hit sweep_as_ray(const typename Kind::Tree& tree, const auto& ray,
                                              Stack& stack) {
    const auto frame = make_frame(ray);
    NoSteps steps;
    const auto hit = find_closest(tree, frame, stack, steps);
    if (hit.prim == no_primitive) return {};
    const auto t_of_caller = hit.t * frame.t_scale + 0;  // -0 becomes +0
    if (!(t_of_caller < infinity)) return {};
    const auto& t = tree.triangles[hit.position];
    const Double3 a(t.v0), b(t.v1), c(t.v2);
    const Double3 at = a + (b - a) * hit.u + (c - a) * hit.v;
    typename Kind::Hit contact{t_of_caller, hit.prim, {}, hit.u, hit.v};
    at.round_to(contact.position);
    return contact;
}

/// The first contact of a valid sweep with a tree that is not empty.
template <class Kind, class Sweep, class Stack>
[[nodiscard]] typename Kind::Hit sweep_one(const typename Kind::Tree& tree, const Sweep& sweep,
                                           Stack& stack) {
    if (sweep.radius == 0) return sweep_as_ray<Kind>(tree, sweep.path, stack);
    const typename Kind::Frame frame(tree, sweep);
    const auto contact = find_first_contact(tree, frame, stack);
    if (contact.prim == no_primitive) return {};
    const auto t = frame.in_units_of_caller(contact.t);
    if (!(t < infinity)) return {};  // farther than numbers go
    const auto at = closest_on_triangle(tree.triangles[contact.position], frame.center(contact.t));
    return {t, contact.prim, at.position, at.u, at.v};
}

}  // namespace raydix
