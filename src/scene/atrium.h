// What the hall of the scene `atrium` is made of. Metres, y up; the nave runs along x.
//
//   z = -9 ........ outer wall with windows
//      aisle, gallery above it at y = 6
//   z = -5 o  o  o  arcade, one column every 4 m, two storeys
//      nave, 32 m long, barrel vault with its crown at y = 16
//   z = +5 o  o  o
//      aisle
//   z = +9 ........
#pragma once

#include "scene/builtin_math.h"
#include "scene/patch_model.h"

namespace raydix::builtin {

struct Hall {
    static constexpr double half_length = 16.0;
    static constexpr double nave = 5.0;   // half width
    static constexpr double outer = 9.0;  // half width with the aisles
    static constexpr double bay = 4.0;
    static constexpr int bays = 8;
    static constexpr double gallery = 6.0;  // height of the upper floor
    static constexpr double spring = 11.0;  // where the vault starts
};

/// How much there is of the small things; larger requests get more of them, not only finer ones.
struct Furnishing {
    bool plain;     // no ornaments at all
    int balusters;  // per bay
    int chairs;     // per table
    int books;      // per shelf
    int chandelier_arms;
    std::uint64_t statue;  // triangles of the figure in the nave, 0: an urn stands there
};
Furnishing furnishing_for(std::uint64_t triangles);

// atrium_shell.cpp
void add_floors_and_walls(PatchModel& model, const Furnishing& amount);
void add_arcades(PatchModel& model, const Furnishing& amount);
void add_vaults(PatchModel& model);
void add_end_windows(PatchModel& model, const Furnishing& amount);
void add_stairs(PatchModel& model, const Furnishing& amount);
void add_balustrades(PatchModel& model, const Furnishing& amount);

// atrium_furniture.cpp
void add_tables(PatchModel& model, const Furnishing& amount, std::uint64_t seed);
void add_bookcases(PatchModel& model, const Furnishing& amount, std::uint64_t seed);
void add_chandeliers(PatchModel& model, const Furnishing& amount);
void add_drapes(PatchModel& model, std::uint64_t seed);
void add_centerpiece(PatchModel& model, const Furnishing& amount, std::uint64_t seed);

}  // namespace raydix::builtin
