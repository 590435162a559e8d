# raydix_sets: the versions of the kernels that this machine can use best. SSE4.2 comes along: all else is built on it.
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
if(RAYDIX_HOST_AVX512)
    set(raydix_sets ENDS)
elseif(RAYDIX_HOST_AVX2)
    set(raydix_sets AVX2)
else()
    set(raydix_sets ONE)
endif()
