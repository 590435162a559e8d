# Kernels for this machine alone: raydix_host_options, what they are compiled with, so that the one set that every
# processor of the build has (raydix_sets, ONE) is this machine's best.
include(CheckCXXSourceCompiles)
set(CMAKE_REQUIRED_FLAGS -march=native)
check_cxx_source_compiles("
    #if !defined(__AVX512F__) || !defined(__AVX512BW__) || !defined(__AVX512CD__) || !defined(__AVX512DQ__) || !defined(__AVX512VL__)
    #error
    #endif
    int main() {}" RAYDIX_HOST_AVX512)
check_cxx_source_compiles("
    #if !defined(__AVX2__) || !defined(__FMA__) || !defined(__BMI2__) || !defined(__F16C__)
    #error
    #endif
    int main() {}" RAYDIX_HOST_AVX2)
unset(CMAKE_REQUIRED_FLAGS)
set(raydix_sets ONE)
if(RAYDIX_HOST_AVX512)
    set(raydix_host_options -march=x86-64-v4 -Wno-ignored-attributes)
elseif(RAYDIX_HOST_AVX2)
    set(raydix_host_options -march=x86-64-v3 -Wno-ignored-attributes)
endif()
