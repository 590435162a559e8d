# CUDA is found or left out by itself. RAYDIX_HAVE_CUDA says which.
set(RAYDIX_HAVE_CUDA OFF)
raydix_nothing_runs(raydix_no_gpu "${RAYDIX_CUDA}" "GPU of NVIDIA" "${raydix_nvidia_gpus}")
if(NOT RAYDIX_CUDA STREQUAL "OFF" AND NOT raydix_no_gpu)
    include(CheckLanguage)
    check_language(CUDA)
    if(CMAKE_CUDA_COMPILER)
        if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
            set(CMAKE_CUDA_ARCHITECTURES 90)
            if(raydix_nvidia_gpus)
                set(CMAKE_CUDA_ARCHITECTURES native)
            endif()
        endif()
        enable_language(CUDA)
        if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)  # CMake before 3.26 does not know that nvcc has C++20
            set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION -std=c++20)
            set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION -std=c++20)
        endif()
        set(CMAKE_CUDA_STANDARD 20)
        set(CMAKE_CUDA_STANDARD_REQUIRED ON)
        find_package(CUDAToolkit REQUIRED)
        # The host's bits: no contraction, no flushed denormals, rounded division and square root.
        add_library(raydix_cuda_options INTERFACE)
        target_compile_options(raydix_cuda_options INTERFACE $<$<COMPILE_LANGUAGE:CUDA>:
            -fmad=false -ftz=false -prec-div=true -prec-sqrt=true -Xcompiler=-ffp-contract=off --expt-relaxed-constexpr
            ${raydix_cuda_warnings}>)
        if(RAYDIX_TESTS)  # tests/device/resources_test.py reads the device code
            target_compile_options(raydix_cuda_options INTERFACE $<$<COMPILE_LANGUAGE:CUDA>:-no-compress>)
        endif()
        set(RAYDIX_HAVE_CUDA ON)
    elseif(RAYDIX_CUDA STREQUAL "ON")
        message(FATAL_ERROR "RAYDIX_CUDA=ON, but no CUDA compiler was found")
    endif()
endif()
