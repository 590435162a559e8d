#if defined(RAYDIX_HAVE_OPENCL)

#include "exec/opencl_device.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "exec/spirv_module.h"

namespace raydix {
namespace {

/// Kernels whose 32 lanes work together.
constexpr std::array<std::string_view, 3> warp_prefixes = {"warps_", "tiles_", "trace_"};

std::string text_of(cl_device_id device, cl_device_info what) {
    const OpenclApi& cl = opencl_api();
    std::size_t bytes = 0;
    if (cl.GetDeviceInfo(device, what, 0, nullptr, &bytes) != CL_SUCCESS || bytes == 0) return {};
    std::string text(bytes, '\0');
    if (cl.GetDeviceInfo(device, what, bytes, text.data(), nullptr) != CL_SUCCESS) return {};
    text.resize(text.find('\0') == std::string::npos ? bytes : text.find('\0'));
    return text;
}

/// Zero if the driver does not know the question.
template <class T>
T value_of(cl_device_id device, cl_device_info what) {
    T value{};
    if (opencl_api().GetDeviceInfo(device, what, sizeof(value), &value, nullptr) != CL_SUCCESS)
        return T{};
    return value;
}

OpenclTraits traits_of(cl_device_id device) {
    OpenclTraits t;
    t.name = text_of(device, CL_DEVICE_NAME);
    t.driver = text_of(device, CL_DRIVER_VERSION);
    t.il_versions = text_of(device, CL_DEVICE_IL_VERSION);
    t.extensions = text_of(device, CL_DEVICE_EXTENSIONS);
    t.single_precision = value_of<cl_device_fp_config>(device, CL_DEVICE_SINGLE_FP_CONFIG);
    t.double_precision = value_of<cl_device_fp_config>(device, CL_DEVICE_DOUBLE_FP_CONFIG);
    t.atomics =
        value_of<cl_device_atomic_capabilities>(device, CL_DEVICE_ATOMIC_MEMORY_CAPABILITIES);
    const auto sizes =
        value_of<std::array<std::size_t, 16>>(device, CL_DEVICE_SUB_GROUP_SIZES_INTEL);
    std::copy_if(sizes.begin(), sizes.end(), std::back_inserter(t.sub_group_sizes),
                 [](std::size_t size) { return size != 0; });
    t.work_group_size = value_of<std::size_t>(device, CL_DEVICE_MAX_WORK_GROUP_SIZE);
    t.local_memory = value_of<cl_ulong>(device, CL_DEVICE_LOCAL_MEM_SIZE);
    t.address_bits = value_of<cl_uint>(device, CL_DEVICE_ADDRESS_BITS);
    t.compute_units = value_of<cl_uint>(device, CL_DEVICE_MAX_COMPUTE_UNITS);
    t.available = value_of<cl_bool>(device, CL_DEVICE_AVAILABLE) != CL_FALSE;
    t.generic_pointers =
        value_of<cl_bool>(device, CL_DEVICE_GENERIC_ADDRESS_SPACE_SUPPORT) != CL_FALSE;
    return t;
}

template <class Function>
Function extension(cl_platform_id platform, const char* name) {
    void* address = opencl_api().GetExtensionFunctionAddressForPlatform(platform, name);
    if (address == nullptr)
        throw BackendUnavailable(std::string("device opencl: the driver has no ") + name);
    return reinterpret_cast<Function>(address);
}

cl_command_queue queue_of(Stream queue) { return static_cast<cl_command_queue>(queue); }

}  // namespace

std::string opencl_lacks(const OpenclTraits& t) {
    std::string lacks;
    const auto need = [&](bool there, const char* what) {
        if (!there) lacks += (lacks.empty() ? "" : ", ") + std::string(what);
    };
    const auto extends = [&](std::string_view name) {
        return (' ' + t.extensions + ' ').find(' ' + std::string(name) + ' ') != std::string::npos;
    };
    need(t.available, "being available");
    need(t.il_versions.find("SPIR-V_1.4") != std::string::npos, "SPIR-V 1.4");
    need(t.address_bits == 64, "64-bit addresses");
    need((t.single_precision & CL_FP_DENORM) != 0, "denormal floats");
    need((t.single_precision & CL_FP_INF_NAN) != 0, "infinities and NaN");
    need((t.single_precision & CL_FP_ROUND_TO_NEAREST) != 0, "rounding to nearest");
    need(t.double_precision != 0, "fp64");
    need(extends("cl_intel_required_subgroup_size") &&
             std::ranges::find(t.sub_group_sizes, 32u) != t.sub_group_sizes.end(),
         "sub-groups of 32 lanes (cl_intel_required_subgroup_size)");
    need(extends("cl_khr_subgroup_ballot"), "cl_khr_subgroup_ballot");
    need(extends("cl_khr_subgroup_shuffle"), "cl_khr_subgroup_shuffle");
    need((t.atomics & CL_DEVICE_ATOMIC_ORDER_ACQ_REL) != 0 &&
             (t.atomics & CL_DEVICE_ATOMIC_SCOPE_DEVICE) != 0,
         "acquire-release atomics for the whole device");
    need(t.generic_pointers, "generic pointers");
    need(extends("cl_intel_unified_shared_memory"), "cl_intel_unified_shared_memory");
    need(t.work_group_size >= OpenclDevice::group_threads, "work-groups of 128");
    return lacks;
}

std::vector<OpenclFound> find_opencl_devices() {
    const OpenclApi& cl = opencl_api();
    cl_uint count = 0;
    const cl_int status = cl.GetPlatformIDs(0, nullptr, &count);
    if (status != CL_SUCCESS || count == 0)
        throw BackendUnavailable("device opencl: the loader found no driver: " +
                                 opencl_status_name(status));
    std::vector<cl_platform_id> platforms(count);
    opencl_try(cl.GetPlatformIDs(count, platforms.data(), nullptr), "clGetPlatformIDs");
    std::vector<OpenclFound> found;
    for (cl_platform_id platform : platforms) {
        if (cl.GetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 0, nullptr, &count) != CL_SUCCESS)
            continue;
        std::vector<cl_device_id> devices(count);
        opencl_try(cl.GetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, count, devices.data(), nullptr),
                   "clGetDeviceIDs");
        for (cl_device_id device : devices) found.push_back({platform, device, traits_of(device)});
    }
    return found;
}

void opencl_build_failed(cl_int status, const std::string& device, const std::string& about) {
    // What CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT says is not asked: drivers of processors round
    // correctly, take the option and do not claim it.
    if (status == CL_INVALID_BUILD_OPTIONS)
        throw BackendUnavailable("device opencl: " + device +
                                 " lacks correctly rounded division and square roots");
    opencl_failed(status, "clBuildProgram", about);
}

OpenclDevice::OpenclDevice(const OpenclFound& found)
    : platform_(found.platform), device_(found.device), traits_(found.traits) {
    const std::string lacks = opencl_lacks(traits_);
    if (!lacks.empty())
        throw BackendUnavailable("device opencl: " + traits_.name + " lacks " + lacks);
    const OpenclApi& cl = opencl_api();
    is_cpu_ = (value_of<cl_device_type>(device_, CL_DEVICE_TYPE) & CL_DEVICE_TYPE_CPU) != 0;
    allocate_ = extension<clDeviceMemAllocINTEL_fn>(platform_, "clDeviceMemAllocINTEL");
    free_ = extension<clMemBlockingFreeINTEL_fn>(platform_, "clMemBlockingFreeINTEL");
    copy_ = extension<clEnqueueMemcpyINTEL_fn>(platform_, "clEnqueueMemcpyINTEL");
    fill_ = extension<clEnqueueMemFillINTEL_fn>(platform_, "clEnqueueMemFillINTEL");
    cl_int status = CL_SUCCESS;
    context_ =
        OpenclContext(cl.CreateContext(nullptr, 1, &device_, OpenclNotes::note, nullptr, &status));
    opencl_try(status, "clCreateContext", traits_.name);
    own_queue_ =
        OpenclQueue(cl.CreateCommandQueueWithProperties(context(), device_, nullptr, &status));
    opencl_try(status, "clCreateCommandQueueWithProperties", traits_.name);
    const std::string wrong = wrong_arithmetic();
    if (!wrong.empty()) throw BackendUnavailable("device opencl: " + traits_.name + " " + wrong);
    note_open();
}

OpenclDevice::~OpenclDevice() {
    note_gone();
    close();
}

void OpenclDevice::close() noexcept {
    if (!closed_.exchange(true)) static_cast<void>(opencl_api().Finish(own_queue()));
}

Stream OpenclDevice::queue(Stream given) {
    if (given == nullptr) return own_queue();
    const OpenclApi& cl = opencl_api();
    auto* queue = static_cast<cl_command_queue>(given);
    cl_context context = nullptr;
    cl_device_id device = nullptr;
    cl_command_queue_properties properties = 0;
    opencl_try(cl.GetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof(context), &context, nullptr),
               "clGetCommandQueueInfo");
    opencl_try(cl.GetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof(device), &device, nullptr),
               "clGetCommandQueueInfo");
    opencl_try(cl.GetCommandQueueInfo(queue, CL_QUEUE_PROPERTIES, sizeof(properties), &properties,
                                      nullptr),
               "clGetCommandQueueInfo");
    if (context != this->context() || device != device_)
        throw InputError("the queue is of another OpenCL context or device than the selected one");
    if ((properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0)
        throw InputError("the OpenCL queue may change the order of launches");
    return queue;
}

void* OpenclDevice::allocate(std::size_t bytes) {
    cl_int status = CL_SUCCESS;
    constexpr std::size_t line = 256;
    const std::size_t lines = (bytes + line - 1) / line * line;
    void* memory = allocate_(context(), device_, nullptr, lines, line, &status);
    if (memory == nullptr)  // perhaps an alignment that it does not take
        memory = allocate_(context(), device_, nullptr, lines, 0, &status);
    opencl_try(status, "clDeviceMemAllocINTEL", std::to_string(bytes) + " bytes");
    if (reinterpret_cast<std::uintptr_t>(memory) % line != 0) {
        free(memory);
        throw DeviceError("clDeviceMemAllocINTEL: memory that is not aligned to 256 bytes");
    }
    return memory;
}

void OpenclDevice::free(void* memory) noexcept {
    if (closed_) return;
    // The driver does not know which launches use it: they only hold pointers to it.
    static_cast<void>(opencl_api().Finish(own_queue()));
    static_cast<void>(free_(context(), memory));
}

void OpenclDevice::copy(Stream queue, void* to, const void* from, std::size_t bytes) {
    opencl_try(copy_(queue_of(queue), CL_FALSE, to, from, bytes, 0, nullptr, nullptr),
               "clEnqueueMemcpyINTEL", std::to_string(bytes) + " bytes");
}

void OpenclDevice::clear(Stream queue, void* memory, std::size_t bytes) {
    const std::uint8_t zero = 0;
    opencl_try(fill_(queue_of(queue), memory, &zero, 1, bytes, 0, nullptr, nullptr),
               "clEnqueueMemFillINTEL", std::to_string(bytes) + " bytes");
}

void OpenclDevice::finish(Stream queue) {
    opencl_try(opencl_api().Finish(queue_of(queue)), "clFinish", traits_.name);
}

cl_program OpenclDevice::program(const char* module) {
    const auto known = programs_.find(std::string_view(module));
    if (known != programs_.end()) return known->second.get();
    const OpenclApi& cl = opencl_api();
    const std::vector<std::uint32_t> words = complete_spirv(spirv_module(module), warp_prefixes);
    cl_int status = CL_SUCCESS;
    OpenclProgram owned(
        cl.CreateProgramWithIL(context(), words.data(), words.size() * sizeof(words[0]), &status));
    opencl_try(status, "clCreateProgramWithIL", module);
    cl_program program = owned.get();
    status = cl.BuildProgram(program, 1, &device_, "-cl-fp32-correctly-rounded-divide-sqrt",
                             nullptr, nullptr);
    close_before_driver();
    if (status != CL_SUCCESS) {
        std::size_t bytes = 0;
        static_cast<void>(
            cl.GetProgramBuildInfo(program, device_, CL_PROGRAM_BUILD_LOG, 0, nullptr, &bytes));
        std::string log(bytes, '\0');
        static_cast<void>(cl.GetProgramBuildInfo(program, device_, CL_PROGRAM_BUILD_LOG, bytes,
                                                 log.data(), nullptr));
        opencl_build_failed(status, traits_.name, std::string(module) + " (" + log.c_str() + ")");
    }
    return programs_.emplace(module, std::move(owned)).first->second.get();
}

cl_kernel OpenclDevice::kernel(const KernelName& name) {
    const auto known = kernels_.find(std::string_view(name.kernel));
    if (known != kernels_.end()) return known->second.get();
    const OpenclApi& cl = opencl_api();
    cl_int status = CL_SUCCESS;
    OpenclKernel kernel(cl.CreateKernel(program(name.module), name.kernel, &status));
    opencl_try(status, "clCreateKernel", name.kernel);
    // Its argument holds pointers to memory that the driver is not told of otherwise.
    const cl_bool yes = CL_TRUE;
    opencl_try(cl.SetKernelExecInfo(kernel.get(), CL_KERNEL_EXEC_INFO_INDIRECT_DEVICE_ACCESS_INTEL,
                                    sizeof(yes), &yes),
               "clSetKernelExecInfo", name.kernel);
    return kernels_.emplace(name.kernel, std::move(kernel)).first->second.get();
}

void OpenclDevice::launch(Stream queue, const KernelName& name, std::size_t groups,
                          std::size_t threads, const void* argument, std::size_t bytes) {
    const OpenclApi& cl = opencl_api();
    const std::lock_guard lock(lock_);
    cl_kernel function = kernel(name);
    opencl_try(cl.SetKernelArg(function, 0, bytes, argument), "clSetKernelArg", name.kernel);
    const std::size_t global = groups * threads;
    opencl_try(cl.EnqueueNDRangeKernel(queue_of(queue), function, 1, nullptr, &global, &threads, 0,
                                       nullptr, nullptr),
               "clEnqueueNDRangeKernel", name.kernel);
}

std::unique_ptr<OpenclDevice> open_opencl_device(std::uint32_t index) {
    const std::vector<OpenclFound> found = find_opencl_devices();
    if (index >= found.size())
        throw BackendUnavailable("device opencl:" + std::to_string(index) + ": there are " +
                                 std::to_string(found.size()) + " OpenCL devices");
    return std::make_unique<OpenclDevice>(found[index]);
}

}  // namespace raydix

#endif
