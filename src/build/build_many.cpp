// Many small trees in one call: a mesh is one thread's, scratch is kept from one to the next.
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/error.h>

#include <string>

#include "build/bvh_builder_double.h"
#include "exec/parallel.h"
#include "tree/bvh_internals.h"

namespace raydix {

void forget_peak(Bvh& tree) { BvhInternals{tree}.peak_bytes() = 0; }

namespace {

template <class Builder, class Tree, class AnyMesh>
std::vector<Tree> build_each(std::span<const AnyMesh> meshes, const BuildOptions& options) {
    std::vector<Tree> trees(meshes.size());
    BuildOptions own = options;
    own.threads = 1;
    with_threads(options.threads, [&] {
        for_each_range(meshes.size(), 1, [&](std::size_t begin, std::size_t end) {
            Builder builder;
            for (std::size_t i = begin; i < end; ++i) {
                try {
                    builder.build(meshes[i], own, trees[i]);
                } catch (const InputError& error) {
                    throw InputError("mesh " + std::to_string(i) + ": " + error.what());
                }
                forget_peak(trees[i]);  // it is of all that is built at the same time
            }
        });
    });
    return trees;
}

}  // namespace

std::vector<Bvh> build_many(std::span<const MeshView> meshes, const BuildOptions& options) {
    return build_each<BvhBuilder, Bvh>(meshes, options);
}

std::vector<BvhD> build_many(std::span<const MeshViewD> meshes, const BuildOptions& options) {
    return build_each<BvhBuilderD, BvhD>(meshes, options);
}

}  // namespace raydix
