// What the library asks the CUDA runtime of its GPUs, over functions of the runtime's names that
// stand for it here: no GPU is needed, and no library of CUDA is linked.
#include <gtest/gtest.h>

#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "exec/cuda_device.cuh"

namespace {

struct Runtime {
    int devices = 2, current = 0;
    cudaError_t last = cudaSuccess;
    std::map<const void*, int> memory;   // where it lies
    std::map<int, cudaError_t> kernels;  // what a GPU says of them, if not success
    std::set<int> busy;                  // GPUs whose default stream has work
    cudaError_t failing_wait = cudaSuccess;

    cudaError_t end(cudaError_t status) {
        if (status != cudaSuccess) last = status;
        return status;
    }
};
Runtime runtime;

}  // namespace

extern "C" {
cudaError_t cudaGetLastError() { return std::exchange(runtime.last, cudaSuccess); }
const char* cudaGetErrorName(cudaError_t) { return "name"; }
const char* cudaGetErrorString(cudaError_t) { return "text"; }
cudaError_t cudaGetDeviceCount(int* count) {
    *count = runtime.devices;
    return runtime.end(runtime.devices == 0 ? cudaErrorNoDevice : cudaSuccess);
}
cudaError_t cudaGetDevice(int* device) {
    *device = runtime.current;
    return runtime.end(runtime.devices == 0 ? cudaErrorNoDevice : cudaSuccess);
}
cudaError_t cudaSetDevice(int device) {
    if (device < 0 || device >= runtime.devices) return runtime.end(cudaErrorInvalidDevice);
    runtime.current = device;
    return cudaSuccess;
}
cudaError_t cudaPointerGetAttributes(cudaPointerAttributes* found, const void* memory) {
    const auto at = runtime.memory.find(memory);
    *found = {};
    found->type = at == runtime.memory.end() ? cudaMemoryTypeUnregistered : cudaMemoryTypeDevice;
    found->device = at == runtime.memory.end() ? -1 : at->second;
    return cudaSuccess;
}
cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
    if (stream == nullptr) runtime.busy.erase(runtime.current);
    return runtime.end(runtime.failing_wait);
}
cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int device) {
    *properties = {};
    static_cast<void>(std::snprintf(properties->name, sizeof(properties->name), "GPU %d", device));
    properties->major = 8;
    properties->minor = 6 + device;
    return cudaSuccess;
}
cudaError_t cudaFuncGetAttributes(cudaFuncAttributes*, const void*) {
    const auto at = runtime.kernels.find(runtime.current);
    return runtime.end(at == runtime.kernels.end() ? cudaSuccess : at->second);
}
}

namespace raydix {
namespace {

class CudaStandIn : public ::testing::Test {
protected:
    void SetUp() override {
        runtime = Runtime();
        runtime.memory = {{&first_, 0}, {&second_, 1}};
        cuda_devices_to_wait_for().clear();
    }
    static cudaError_t failing() { return runtime.end(cudaErrorMemoryAllocation); }

    char first_ = 0, second_ = 0, host_ = 0;
};

TEST_F(CudaStandIn, AFailedCallDoesNotFailTheNextLaunch) {
    EXPECT_THROW(RAYDIX_CUDA_TRY(failing()), DeviceError);
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
}

TEST_F(CudaStandIn, CallsGoToTheGpuOfTheirMemory) {
    EXPECT_EQ(enter_cuda_device(&first_), -1);
    EXPECT_EQ(enter_cuda_device(&host_), -1);
    EXPECT_EQ(enter_cuda_device(nullptr), -1);
    EXPECT_EQ(runtime.current, 0);
    const int before = enter_cuda_device(&second_);
    EXPECT_EQ(before, 0);
    EXPECT_EQ(runtime.current, 1);
    const int within = enter_cuda_device(&second_);
    leave_cuda_device(within);
    EXPECT_EQ(runtime.current, 1);
    leave_cuda_device(before);
    EXPECT_EQ(runtime.current, 0);
}

TEST_F(CudaStandIn, WithoutAGpuNothingIsEntered) {
    runtime.devices = 0;
    EXPECT_EQ(enter_cuda_device(&second_), -1);
    EXPECT_EQ(cuda_device_of(nullptr), -1);
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
}

TEST_F(CudaStandIn, TheDefaultStreamsOfAllGpusAreWaitedFor) {
    leave_cuda_device(enter_cuda_device(&second_));
    runtime.busy = {0, 1};
    synchronize_cuda(reinterpret_cast<cudaStream_t>(&host_));  // a stream of the caller's
    EXPECT_EQ(runtime.busy, (std::set{0, 1}));
    synchronize_cuda(nullptr);
    EXPECT_EQ(runtime.busy, std::set<int>());
    EXPECT_EQ(runtime.current, 0);
    runtime.busy = {1};  // not this thread's work
    synchronize_cuda(nullptr);
    EXPECT_EQ(runtime.busy, std::set{1});
}

TEST_F(CudaStandIn, AWaitThatFailsLeavesTheCallersGpuCurrent) {
    leave_cuda_device(enter_cuda_device(&second_));
    runtime.failing_wait = cudaErrorLaunchFailure;
    EXPECT_THROW(synchronize_cuda(nullptr), DeviceError);
    EXPECT_EQ(runtime.current, 0);
}

TEST_F(CudaStandIn, AGpuWithoutKernelsIsNamed) {
    EXPECT_EQ(find_cuda_device(&host_, {900}).missing, "");
    EXPECT_EQ(find_cuda_device(&host_, {900}).name, "GPU 0");
    runtime.current = 1;
    runtime.kernels = {{1, cudaErrorNoKernelImageForDevice}};
    EXPECT_EQ(find_cuda_device(&host_, {800, 900}).missing,
              "device cuda: GPU 1 is sm_87; this build has kernels for sm_80, sm_90");
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
    runtime.kernels = {{1, cudaErrorMemoryAllocation}};  // says nothing of kernels
    EXPECT_THROW(static_cast<void>(find_cuda_device(&host_, {900})), DeviceError);
}

}  // namespace
}  // namespace raydix
