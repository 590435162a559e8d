// Scene `atrium`: a vaulted hall with galleries and furniture. Description -> patches -> mesh and
// five cameras inside.
#include "scene/atrium.h"
#include "scene/builtin.h"

namespace raydix::builtin {

Furnishing furnishing_for(std::uint64_t triangles) {
    if (triangles < 75'000) return {true, 2, 2, 0, 4, 0};
    if (triangles < 300'000) return {false, 8, 6, 12, 8, 8'000};
    return {false, 12, 8, 30, 12, triangles / 10};
}

BuiltinResult make_atrium(std::uint64_t triangles, std::uint64_t seed) {
    const Furnishing amount = furnishing_for(triangles);
    PatchModel model(amount.plain ? 0.6 : 1.0);
    add_floors_and_walls(model, amount);
    add_arcades(model, amount);
    add_vaults(model);
    add_end_windows(model, amount);
    add_stairs(model, amount);
    add_balustrades(model, amount);
    add_tables(model, amount, seed);
    add_bookcases(model, amount, seed);
    add_chandeliers(model, amount);
    add_drapes(model, seed);
    add_centerpiece(model, amount, seed);

    BuiltinResult result;
    result.mesh = model.tessellate(triangles);
    result.cameras.ao_radius = 2.5f;
    result.cameras.cameras = {
        camera("nave", {-4.0f, 1.8f, 0.4f}, {10.0f, 3.2f, -0.3f}, 65.0f),
        camera("stairs", {7.0f, 5.0f, 1.5f}, {-13.0f, 5.2f, -0.5f}, 60.0f),
        camera("gallery", {-10.0f, 7.9f, 6.6f}, {8.0f, 7.0f, -3.0f}, 65.0f),
        camera("aisle", {-14.0f, 1.7f, 7.2f}, {6.0f, 2.2f, 6.4f}, 65.0f),
        camera("table", {1.9f, 1.5f, 0.2f}, {4.6f, 0.8f, 2.4f}, 55.0f),
    };
    return result;
}

}  // namespace raydix::builtin
