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

#include "cpu_options.h"

namespace raydix::bench {

/// One way to send a batch of rays through a tree. Both calls return when all rays are done.
struct Mode {
    std::string name;
    bool single = false;     // one ray a call, in a parallel loop
    bool automatic = false;  // what a user gets who asks for nothing
    std::function<void(std::span<const Ray>, std::span<Hit>, int threads)> closest;
    std::function<void(std::span<const Ray>, std::span<std::uint8_t>, int threads)> any;
};

/// Bytes that a trace touches: of the tree's own, and of the caller's arrays that it reads.
struct PeerBytes {
    std::uint64_t own = 0, referenced = 0;
};

class Peer {
public:
    virtual ~Peer() = default;
    /// Before each build(), outside of its time.
    virtual void prepare() {}
    /// From vertices and indices to what can be traced. Again: into the memory that is kept.
    virtual void build() = 0;
    /// How much of the last build went to the layout that is traced, if that is a step of its own.
    [[nodiscard]] virtual std::optional<double> layout_ms() const { return std::nullopt; }
    [[nodiscard]] virtual PeerBytes bytes() = 0;
    /// Of the binary tree, node 1 and triangle 1; nothing if the peer has no binary tree to show.
    [[nodiscard]] virtual std::optional<double> sah() { return std::nullopt; }
    /// They refer to the peer.
    [[nodiscard]] virtual std::vector<Mode> modes() const = 0;
};

struct PeerName {
    std::string text;  // "raydix balanced", "embree medium+robust"
    [[nodiscard]] bool ours() const { return text.starts_with("raydix "); }
    [[nodiscard]] std::string kind() const { return text.substr(7); }
};
/// Embree's first, then ours, so that a round goes from one side to the other. Throws
/// CLI::ValidationError for a kind that does not exist.
[[nodiscard]] std::vector<PeerName> peers_of(const CpuBench& options);

/// The mesh must outlive the peer. Its vertex array must have room for one more element (Embree
/// reads 16 bytes a vertex).
[[nodiscard]] std::unique_ptr<Peer> make_peer(const PeerName& name, const Mesh& mesh,
                                              const CpuBench& options, int threads);

}  // namespace raydix::bench
