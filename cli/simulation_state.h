// What a long simulation has counted so far, in a file: it can be ended and gone on with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "output.h"
#include "simulation.h"

namespace raydix::cli {

/// What figures of rows over launches of one kind depend on: not the threads, nor when to end.
[[nodiscard]] Json figures_of(const SceneTree& input, const std::vector<SimulationRow>& rows,
                              const LaunchOptions& launches, std::uint64_t seed);

/// JSON: for each scene, builder and kind of ray the launches that are done and the sums over them.
class SimulationState {
public:
    /// Reads the file if it is there. Throws InputError if it holds something else.
    explicit SimulationState(std::string file);

    /// Puts what is kept of `figures` into rows that are new; how many launches that was. Throws
    /// InputError if what is kept of scene, builder and kind depends on something else.
    [[nodiscard]] std::size_t restore(const Json& figures, std::vector<SimulationRow>& rows) const;
    using AllTimes = std::span<const std::shared_ptr<LaunchTimes>>;
    /// The same of what all launches take, as many as are done.
    void restore_times(const Json& figures, const std::vector<SimulationRow>& rows,
                       AllTimes times) const;
    /// Throw InputError if the file cannot be written; the file before it stays.
    void keep_times(const Json& figures, const std::vector<SimulationRow>& rows, AllTimes times);
    void keep(const Json& figures, const std::vector<SimulationRow>& rows, std::size_t launches);

private:
    /// The part of such rows, or null. Throws InputError if it depends on something else.
    [[nodiscard]] const Json* part_of(const Json& figures,
                                      const std::vector<SimulationRow>& rows) const;
    void write() const;

    std::string file_;
    Json document_;
};

}  // namespace raydix::cli
