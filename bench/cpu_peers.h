// The two sides of `bench cpu` behind one interface: a peer builds its tree over a mesh, says what
// it weighs, and lists its modes, the ways in which rays can be sent through it.
#pragma once

#include <raydix/mesh.h>
#include <raydix/types.h>

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cpu_figures.h"
#include "cpu_options.h"

namespace raydix::bench {

/// One way to send rays through a tree. Both calls return when all rays are done, and work with as
/// many threads as the calling context has (with_threads).
struct Mode {
    std::string name;
    bool single = false;     // one ray a call, in a parallel loop
    bool automatic = false;  // what a user gets who asks for nothing
    std::function<void(std::span<const Ray>, std::span<Hit>)> closest;
    std::function<void(std::span<const Ray>, std::span<std::uint8_t>)> any;
};

class Peer {
public:
    virtual ~Peer() = default;
    /// From the caller's vertices and indices to what can be traced. The first call makes the
    /// scene; the others say that the mesh has changed and commit again.
    virtual void build() = 0;
    /// How much of the last build copied the mesh, if it does so.
    [[nodiscard]] virtual std::optional<double> copy_ms() const { return std::nullopt; }
    [[nodiscard]] virtual PeerBytes bytes() = 0;
    /// Of the binary tree, node 1 and triangle 1; nothing if the peer has no binary tree to show.
    [[nodiscard]] virtual std::optional<double> sah() { return std::nullopt; }
    /// They refer to the peer.
    [[nodiscard]] virtual std::vector<Mode> modes() const = 0;
};

/// Embree's first, then ours, so that a round goes from one side to the other. Throws
/// CLI::ValidationError for a kind that does not exist.
[[nodiscard]] std::vector<PeerName> peers_of(const CpuBench& options);

/// The mesh must outlive the peer. Its vertex array must have room for one more element (Embree
/// reads 16 bytes a vertex).
[[nodiscard]] std::unique_ptr<Peer> make_peer(const PeerName& name, const Mesh& mesh,
                                              const CpuBench& options, int threads);

}  // namespace raydix::bench
