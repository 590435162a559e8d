// JSON -> a machine of the simulator, with errors that name the file and the field.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/simulate.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/printable.h"
#include "scene/byte_source.h"
#include "scene/json_input.h"
#include "simt/op.h"

namespace raydix {
namespace {

using nlohmann::json;

constexpr std::uint64_t largest_file = 1 << 20;

class MachineReader {
public:
    MachineReader(const ByteSource& in, const json& document) : in_(in), document_(document) {}

    MachineModel read() {
        if (!document_.is_object()) in_.fail("machine", "not a JSON object");
        based_ = document_.contains("base");
        if (based_) read_base();
        m_.name = document_.contains("name") ? text(document_["name"], "name") : "custom";
        m_.origin = document_.contains("origin") ? text(document_["origin"], "origin")
                    : based_                     ? fmt::format("{}, changed", m_.origin)
                                                 : "a file";
        known_ = {"base", "name", "origin", "costs"};
        whole("multiprocessors", m_.multiprocessors);
        number("clock_ghz", m_.clock_ghz);
        number("lanes_per_clock", m_.lanes_per_clock);
        number("warp_issue_clocks", m_.warp_issue_clocks);
        delay("read_clocks", m_.read_clocks);
        delay("stack_read_clocks", m_.stack_read_clocks);
        read_release();
        whole("resident_lanes", m_.resident_lanes);
        whole("block_lanes", m_.block_lanes);
        whole_optional("registers", m_.registers);
        whole_optional("shared_bytes", m_.shared_bytes);
        whole_optional("l1_shared_bytes", m_.l1_shared_bytes);
        number("l1_transactions_per_clock", m_.l1_transactions_per_clock);
        whole("l1_bytes", m_.l1_bytes, 0);
        whole_optional("l1_line_bytes", m_.l1_line_bytes);
        number("l2_gb_per_s", m_.l2_gb_per_s);
        whole("l2_bytes", m_.l2_bytes);
        number("dram_gb_per_s", m_.dram_gb_per_s);
        whole_optional("texture_bytes", m_.texture_bytes);
        whole_optional("texture_sharers", m_.texture_sharers);
        delay("texture_fetches_per_clock", m_.texture_fetches_per_clock);
        flag("replays", m_.replays);
        flag("nodes_by_texture", m_.nodes_by_texture);
        delay("texture_clocks", m_.texture_clocks);
        delay("l1_clocks", m_.l1_clocks);
        delay("l2_clocks", m_.l2_clocks);
        delay("dram_clocks", m_.dram_clocks);
        for (const auto& [key, value] : document_.items())
            if (std::find(known_.begin(), known_.end(), key) == known_.end())
                in_.fail(key, "not a field of a machine");
        read_costs();
        return m_;
    }

private:
    void read_base() {
        try {
            m_ = machine_model(text(document_["base"], "base"));
        } catch (const InputError& error) {
            const std::string reason = error.what();
            if (reason.starts_with(in_.name())) throw;  // it is no text
            in_.fail("base", reason);
        }
    }
    std::string text(const json& value, const char* key) const {
        if (!value.is_string()) in_.fail(key, "not a text");
        std::string given = value.get<std::string>();
        if (given.empty()) in_.fail(key, "empty");
        if (printable(std::string_view(given)) != given) in_.fail(key, "has control characters");
        return given;
    }
    const json* find(const char* key) {
        known_.emplace_back(key);
        const auto found = document_.find(key);
        if (found != document_.end()) return &*found;
        if (!based_) in_.fail(key, "missing, and there is no \"base\" to take it from");
        return nullptr;
    }
    void number(const char* key, double& value) {
        const json* found = find(key);
        if (found == nullptr) return;
        const double given = found->is_number() ? found->get<double>() : -1.0;
        if (!(given >= 1e-6 && given <= 1e15)) in_.fail(key, "not a number from 1e-6 to 1e15");
        value = given;
    }
    /// A field that may be left out, base or not.
    const json* find_optional(const char* key) {
        known_.emplace_back(key);
        const auto found = document_.find(key);
        return found != document_.end() ? &*found : nullptr;
    }
    void delay(const char* key, double& value) {
        const json* found = find_optional(key);
        if (found == nullptr) return;
        const double given = found->is_number() ? found->get<double>() : -1.0;
        if (!(given >= 0 && given <= 1e9)) in_.fail(key, "not a number from 0 to 1e9");
        value = given;
    }
    void read_release() {
        const json* found = find_optional("block_release");
        if (found == nullptr) return;
        const std::string name = text(*found, "block_release");
        const auto names = block_release_names();
        const auto at = std::find(names.begin(), names.end(), name);
        if (at == names.end()) in_.fail("block_release", "not own, in_order or together");
        m_.block_release = static_cast<BlockRelease>(at - names.begin());
    }
    void whole(const char* key, std::uint32_t& value, std::uint32_t least = 1) {
        if (find(key) != nullptr) take_whole(key, value, least);
    }
    void whole_optional(const char* key, std::uint32_t& value) {
        if (find_optional(key) != nullptr) take_whole(key, value, 0);
    }
    void take_whole(const char* key, std::uint32_t& value, std::uint32_t least) {
        const std::uint64_t given = find_whole(in_, document_, key, "machine").value();
        if (given < least || given > std::numeric_limits<std::uint32_t>::max())
            in_.fail(key, fmt::format("not from {} to 2^32 - 1", least));
        value = static_cast<std::uint32_t>(given);
    }
    void flag(const char* key, bool& value) {
        const json* found = find_optional(key);
        if (found == nullptr) return;
        if (!found->is_boolean()) in_.fail(key, "not true or false");
        value = found->get<bool>();
    }

    /// {"visit_node": 50, ...}, or a list of {"operation", "instructions", "origin", "kernel"}, as
    /// documents of `raydix simulate` have it. Without "kernel" a cost holds for all kernels, also
    /// for those that the base counts apart.
    void read_costs() {
        const json* costs = find("costs");
        if (costs == nullptr) return;
        std::vector<OperationCost> given;
        if (costs->is_object()) {
            for (const auto& [operation, value] : costs->items())
                given.push_back(cost_of(operation, value));
        } else if (costs->is_array()) {
            for (const json& entry : *costs) given.push_back(cost_of(entry));
        } else {
            in_.fail("costs", "neither an object nor a list");
        }
        replace_costs(given);
        for (const std::string_view operation : op_names)
            for (const WarpKernel kernel : warp_kernel_family()) require_cost(operation, kernel);
    }
    OperationCost cost_of(const json& entry) const {
        if (!entry.is_object() || !entry.contains("operation") || !entry.contains("instructions"))
            in_.fail("costs", "an entry without \"operation\" or \"instructions\"");
        for (const auto& [key, value] : entry.items())
            if (key != "operation" && key != "instructions" && key != "origin" && key != "kernel" &&
                key != "most" && key != "half_rate")
                in_.fail("costs", fmt::format("{} is not a field of an entry", key));
        OperationCost cost = cost_of(text(entry["operation"], "costs"), entry["instructions"]);
        if (entry.contains("most")) cost.most = cost_of(cost.operation, entry["most"]).instructions;
        if (entry.contains("half_rate"))
            cost.half_rate = cost_of(cost.operation, entry["half_rate"]).instructions;
        if (entry.contains("origin")) cost.origin = text(entry["origin"], "origin");
        if (!entry.contains("kernel")) return cost;
        cost.kernel = text(entry["kernel"], "kernel");
        const auto kernels = warp_kernels();
        if (std::none_of(kernels.begin(), kernels.end(),
                         [&](WarpKernel k) { return warp_kernel_name(k) == cost.kernel; }))
            in_.fail("costs", fmt::format("there is no kernel {}", cost.kernel));
        return cost;
    }
    OperationCost cost_of(const std::string& operation, const json& value) const {
        if (std::find(op_names.begin(), op_names.end(), operation) == op_names.end())
            in_.fail("costs", fmt::format("there is no operation {}", operation));
        if (!value.is_number_unsigned() || value.get<std::uint64_t>() > 100'000)
            in_.fail("costs", fmt::format("{} is not an integer from 0 to 100000", operation));
        return {operation, value.get<std::uint32_t>(), "a file"};
    }
    void replace_costs(const std::vector<OperationCost>& given) {
        for (const OperationCost& cost : given) {
            const auto same = [&](const OperationCost& c) {
                return c.operation == cost.operation && c.kernel == cost.kernel;
            };
            if (std::count_if(given.begin(), given.end(), same) > 1)
                in_.fail("costs", fmt::format("{} has two costs", cost.operation));
            std::erase_if(m_.costs, [&](const OperationCost& c) {
                return c.operation == cost.operation && (cost.kernel.empty() || same(c));
            });
        }
        m_.costs.insert(m_.costs.end(), given.begin(), given.end());
    }
    void require_cost(std::string_view operation, WarpKernel kernel) const {
        if (std::none_of(m_.costs.begin(), m_.costs.end(), [&](const OperationCost& c) {
                return c.operation == operation &&
                       (c.kernel.empty() || c.kernel == warp_kernel_name(kernel));
            }))
            in_.fail("costs",
                     fmt::format("{} is missing for {}", operation, warp_kernel_name(kernel)));
    }

    const ByteSource& in_;
    const json& document_;
    MachineModel m_;
    bool based_ = false;
    std::vector<std::string> known_;
};

}  // namespace

MachineModel load_machine_model(const std::filesystem::path& file) {
    ByteSource in = ByteSource::from_file(file, packing_of(file));
    const std::string text = read_rest(in, largest_file);
    const nlohmann::json document = parse_json(in, text);
    return MachineReader(in, document).read();
}

}  // namespace raydix
