// Many small trees in one call: a mesh is one thread's, scratch is kept from one to the next.
#include <raydix/error.h>
#include <raydix/instances.h>

#include <string>

#include "exec/parallel.h"
#include "tree/bvh_access.h"

namespace raydix {

std::vector<Bvh> build_many(std::span<const MeshView> meshes, const BuildOptions& options) {
    std::vector<Bvh> trees(meshes.size());
    BuildOptions own = options;
    own.threads = 1;
    with_threads(options.threads, [&] {
        for_each_range(meshes.size(), 1, [&](std::size_t begin, std::size_t end) {
            BvhBuilder builder;
            for (std::size_t i = begin; i < end; ++i) {
                try {
                    builder.build(meshes[i], own, trees[i]);
                } catch (const InputError& error) {
                    throw InputError("mesh " + std::to_string(i) + ": " + error.what());
                }
                // Of all that is built at the same time: says nothing of this tree.
                BvhAccess{trees[i]}.peak_bytes() = 0;
            }
        });
    });
    return trees;
}

}  // namespace raydix
