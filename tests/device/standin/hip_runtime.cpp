// A stand-in for AMD's libamdhip64.so, for tests: it does for the library what a HIP runtime does,
// and runs the kernels on an OpenCL device for processors. Modules must be code objects for the
// device's architecture, with the kernels that are asked for; a launch must fit what the code
// object says of its kernel: groups, one argument, its bytes. What runs then is the kernel of the
// same name that clang made of the same source for OpenCL: so a test proves the library's calls and
// arguments, not the code objects' instructions.
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "code_object_reader.h"
#include "exec/hip_api.h"
#include "exec/opencl_device.h"
#include "exec/spirv_module.h"
#include "standin.h"

namespace {

using namespace raydix;
using namespace raydix::standin;

constexpr HipStatus invalid_value = 1, out_of_memory = 2, invalid_configuration = 9,
                    invalid_device = 101, invalid_image = 200, no_binary = 209,
                    invalid_handle = 400, not_found = 500, launch_failure = 719;

struct Failure {
    HipStatus status;
    int after;
};

struct State {
    std::mutex lock;
    std::vector<std::string> architectures{"gfx90a", "gfx1100"};
    std::map<std::string, Failure, std::less<>> failures;
    std::set<void*> memory, modules, streams;
    std::uint64_t launches = 0, waits = 0, kernels_of_module = 0;
};
State& state() {
    static auto& all = *new State;
    return all;
}
thread_local int current = 0;

OpenclDevice& device() {
    static auto& opened = *open_opencl_device(0).release();
    return opened;
}

/// The status that a test wants this call to have.
HipStatus planned(std::string_view call) {
    const std::lock_guard guard(state().lock);
    const auto failure = state().failures.find(call);
    if (failure == state().failures.end() || failure->second.after-- > 0) return hip_success;
    return failure->second.status;
}

/// `run` may throw: the text is lost, as it is in a runtime of C functions.
template <class Run>
HipStatus answer(const char* call, HipStatus otherwise, const Run& run) {
    if (const HipStatus status = planned(call); status != hip_success) return status;
    try {
        return run();
    } catch (const std::exception&) {
        return otherwise;
    }
}

/// Kernel -> the SPIR-V module that has it.
const std::map<std::string, std::string>& spirv_kernels() {
    static const std::map<std::string, std::string> all = [] {
        std::map<std::string, std::string> modules;
        for (const char* module : {"sort", "sorted", "build", "hploc", "trees", "queries", "trace",
                                   "trace_votes", "cwbvh"}) {
            const std::vector<std::uint32_t> words = spirv_module(module);
            for (std::size_t k = 5; k < words.size(); k += words[k] >> 16)
                if ((words[k] & 0xFFFF) == 15)  // an entry point: its name is the fourth word on
                    modules.emplace(reinterpret_cast<const char*>(&words[k + 3]), module);
        }
        return modules;
    }();
    return all;
}

struct Function {
    std::string kernel, module;
    KernelNote note;
};
struct Module {
    CodeObject code;
    std::map<std::string, Function> functions;
};

Stream queue_of(HipStream stream) { return device().queue(stream); }

HipStatus launch(const Function& function, const unsigned* grid, const unsigned* block,
                 HipStream stream, void** extra) {
    if (extra == nullptr || extra[0] != reinterpret_cast<void*>(1) ||
        extra[2] != reinterpret_cast<void*>(2) || extra[4] != reinterpret_cast<void*>(3))
        return invalid_value;
    const std::size_t bytes = *static_cast<std::size_t*>(extra[3]);
    const std::uint64_t threads = std::uint64_t{grid[0]} * block[0];
    const KernelNote& note = function.note;
    if (note.arguments != 1 || bytes != note.argument_bytes || bytes > note.argument_segment)
        return invalid_value;
    if (grid[0] == 0 || block[0] == 0 || block[0] > note.most_threads || threads >> 32 != 0 ||
        grid[1] != 1 || grid[2] != 1 || block[1] != 1 || block[2] != 1)
        return invalid_configuration;
    device().launch(queue_of(stream), {function.module.c_str(), function.kernel.c_str()}, grid[0],
                    block[0], extra[1], bytes);
    const std::lock_guard guard(state().lock);
    ++state().launches;
    return hip_success;
}

}  // namespace

extern "C" {

void standin_devices(const char* architectures) {
    const std::lock_guard guard(state().lock);
    std::istringstream words(architectures);
    state().architectures.clear();
    for (std::string word; words >> word;) state().architectures.push_back(word);
}
void standin_fail(const char* call, int status, int after) {
    const std::lock_guard guard(state().lock);
    state().failures[call] = {status, after};
}
void standin_heal() {
    const std::lock_guard guard(state().lock);
    state().failures.clear();
}
void standin_figures(Figures* figures) {
    const std::lock_guard guard(state().lock);
    *figures = {state().memory.size(), state().modules.size(), state().streams.size(),
                state().launches,      state().waits,          state().kernels_of_module,
                spirv_kernels().size()};
}

HipStatus hipInit(unsigned) { return planned("hipInit"); }
HipStatus hipRuntimeGetVersion(int* version) {
    *version = 60443484;  // 6.4
    return hip_success;
}
HipStatus hipGetDeviceCount(int* count) {
    *count = static_cast<int>(state().architectures.size());
    return *count == 0 ? hip_no_device : planned("hipGetDeviceCount");
}
HipStatus hipGetDevice(int* index) {
    *index = current;
    return hip_success;
}
HipStatus hipSetDevice(int index) {
    if (index < 0 || index >= static_cast<int>(state().architectures.size())) return invalid_device;
    current = index;
    return planned("hipSetDevice");
}
HipStatus hipDeviceGetName(char* name, int bytes, int index) {
    const std::string text = "stand-in " + std::to_string(index) + " on " + device().name();
    std::strncpy(name, text.c_str(), static_cast<std::size_t>(bytes));
    return hip_success;
}
HipStatus hipDeviceGetAttribute(int* value, int attribute, int) {
    if (attribute != hip_multiprocessor_count) return invalid_value;
    *value = 2;
    return hip_success;
}
/// As of ROCm 6.0: the architecture lies 1,160 bytes behind the begin, with features behind it.
HipStatus hipGetDevicePropertiesR0600(void* properties, int index) {
    const std::string text = state().architectures.at(static_cast<std::size_t>(index)) + ":xnack-";
    std::memcpy(static_cast<char*>(properties) + 1160, text.c_str(), text.size() + 1);
    return hip_success;
}
const char* hipGetErrorString(HipStatus status) {
    switch (status) {
        case invalid_value:
            return "invalid argument";
        case out_of_memory:
            return "out of memory";
        case invalid_configuration:
            return "invalid configuration argument";
        case hip_no_device:
            return "no ROCm-capable device is detected";
        case invalid_image:
            return "device kernel image is invalid";
        case no_binary:
            return "no kernel image is available for execution on the device";
        case not_found:
            return "named symbol not found";
        case launch_failure:
            return "unspecified launch failure";
        default:
            return "unknown error";
    }
}

HipStatus hipModuleLoadData(HipModule* module, const void* image) {
    return answer("hipModuleLoadData", invalid_image, [&] {
        const auto code = read_code_object(static_cast<const char*>(image));
        if (!code) return invalid_image;
        if (!code->target.ends_with("--" +
                                    state().architectures.at(static_cast<std::size_t>(current))))
            return no_binary;
        auto* loaded = new Module{*code, {}};
        *module = reinterpret_cast<HipModule>(loaded);
        const std::lock_guard guard(state().lock);
        state().modules.insert(loaded);
        state().kernels_of_module = 0;
        for (const auto& [name, note] : code->kernels)
            state().kernels_of_module += spirv_kernels().contains(name);
        return hip_success;
    });
}
HipStatus hipModuleUnload(HipModule module) {
    const std::lock_guard guard(state().lock);
    if (state().modules.erase(module) == 0) return invalid_handle;
    delete reinterpret_cast<Module*>(module);
    return hip_success;
}
HipStatus hipModuleGetFunction(HipFunction* function, HipModule module, const char* name) {
    return answer("hipModuleGetFunction", not_found, [&] {
        auto& loaded = *reinterpret_cast<Module*>(module);
        const auto note = loaded.code.kernels.find(name);
        const auto spirv = spirv_kernels().find(name);
        if (note == loaded.code.kernels.end() || spirv == spirv_kernels().end()) return not_found;
        const std::lock_guard guard(state().lock);
        auto& made = loaded.functions[name] = {name, spirv->second, note->second};
        *function = reinterpret_cast<HipFunction>(&made);
        return hip_success;
    });
}
HipStatus hipModuleLaunchKernel(HipFunction function, unsigned grid_x, unsigned grid_y,
                                unsigned grid_z, unsigned block_x, unsigned block_y,
                                unsigned block_z, unsigned, HipStream stream, void** arguments,
                                void** extra) {
    return answer("hipModuleLaunchKernel", launch_failure, [&] {
        const unsigned grid[] = {grid_x, grid_y, grid_z}, block[] = {block_x, block_y, block_z};
        if (arguments != nullptr) return invalid_value;
        return launch(*reinterpret_cast<const Function*>(function), grid, block, stream, extra);
    });
}

HipStatus hipMalloc(void** memory, std::size_t bytes) {
    return answer("hipMalloc", out_of_memory, [&] {
        *memory = device().allocate(bytes);
        const std::lock_guard guard(state().lock);
        state().memory.insert(*memory);
        return hip_success;
    });
}
HipStatus hipFree(void* memory) {
    {
        const std::lock_guard guard(state().lock);
        if (state().memory.erase(memory) == 0) return invalid_value;
    }
    device().free(memory);
    return hip_success;
}
HipStatus hipMemcpyAsync(void* to, const void* from, std::size_t bytes, int kind,
                         HipStream stream) {
    return answer("hipMemcpyAsync", invalid_value, [&] {
        if (kind != hip_memcpy_default) return invalid_value;
        device().copy(queue_of(stream), to, from, bytes);
        return hip_success;
    });
}
HipStatus hipMemsetAsync(void* memory, int value, std::size_t bytes, HipStream stream) {
    return answer("hipMemsetAsync", invalid_value, [&] {
        if (value != 0) return invalid_value;
        device().clear(queue_of(stream), memory, bytes);
        return hip_success;
    });
}
HipStatus hipStreamCreateWithFlags(HipStream* stream, unsigned flags) {
    return answer("hipStreamCreateWithFlags", out_of_memory, [&] {
        if (flags != hip_stream_non_blocking) return invalid_value;
        cl_int status = CL_SUCCESS;
        cl_command_queue queue = opencl_api().CreateCommandQueueWithProperties(
            device().context(), device().id(), nullptr, &status);
        opencl_try(status, "clCreateCommandQueueWithProperties");
        *stream = reinterpret_cast<HipStream>(queue);
        const std::lock_guard guard(state().lock);
        state().streams.insert(queue);
        return hip_success;
    });
}
HipStatus hipStreamSynchronize(HipStream stream) {
    try {  // a wait that a test makes fail has waited too
        device().finish(queue_of(stream));
        const std::lock_guard guard(state().lock);
        ++state().waits;
    } catch (const std::exception&) {
        return launch_failure;
    }
    return planned("hipStreamSynchronize");
}
HipStatus hipStreamDestroy(HipStream stream) {
    const std::lock_guard guard(state().lock);
    if (state().streams.erase(stream) == 0) return invalid_handle;
    opencl_api().ReleaseCommandQueue(reinterpret_cast<cl_command_queue>(stream));
    return hip_success;
}
}
