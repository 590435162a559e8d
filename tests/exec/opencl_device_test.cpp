// What is said of a driver that does not compile a module of kernels. No driver is needed.
#include <gtest/gtest.h>

#if defined(RAYDIX_HAVE_OPENCL)

#include "exec/opencl_device.h"

namespace raydix {
namespace {

TEST(OpenclDevice, ADeviceThatDoesNotRoundCorrectlyIsRefused) {
    try {
        opencl_build_failed(CL_INVALID_BUILD_OPTIONS, "some GPU", "sort ()");
    } catch (const BackendUnavailable& error) {
        EXPECT_STREQ(error.what(),
                     "device opencl: some GPU lacks correctly rounded division and square roots");
    }
    EXPECT_THROW(opencl_build_failed(CL_BUILD_PROGRAM_FAILURE, "some GPU", "sort (bad word)"),
                 DeviceError);
}

}  // namespace
}  // namespace raydix

#endif
