# Kernels for OpenCL: src/gpu/kernels/*.hip, which clang compiles to SPIR-V as HIP-language code without ROCm or CUDA, and
# llc writes. They are found or left out by themselves. RAYDIX_HAVE_OPENCL says which. The library embeds the modules and
# opens the OpenCL loader when a device is asked for; it links nothing.
set(RAYDIX_OPENCL AUTO CACHE STRING "AUTO, ON or OFF")
set_property(CACHE RAYDIX_OPENCL PROPERTY STRINGS AUTO ON OFF)
set(RAYDIX_HAVE_OPENCL OFF)
raydix_nothing_runs(raydix_no_opencl "${RAYDIX_OPENCL}" "OpenCL driver" "${raydix_opencl_drivers}")
if(RAYDIX_OPENCL STREQUAL "OFF" OR raydix_no_opencl)
    return()
endif()

# The first version whose gpuintrin.h knows SPIR-V, up to versions that are not there yet.
set(raydix_clang_names)
set(raydix_llc_names)
foreach(version RANGE 30 22 -1)
    list(APPEND raydix_clang_names clang++-${version})
    list(APPEND raydix_llc_names llc-${version})
endforeach()
find_program(RAYDIX_KERNEL_CLANG NAMES ${raydix_clang_names} DOC "clang++ 22 or newer, for device code")
if(RAYDIX_KERNEL_CLANG)
    string(REGEX REPLACE "^.*clang\\+\\+" "" raydix_clang_suffix "${RAYDIX_KERNEL_CLANG}")
    find_program(RAYDIX_KERNEL_LLC NAMES llc${raydix_clang_suffix} DOC "llc of the same version")
endif()
find_path(RAYDIX_OPENCL_HEADERS CL/cl_ext.h DOC "The headers of OpenCL 3.0")
if(NOT RAYDIX_KERNEL_CLANG OR NOT RAYDIX_KERNEL_LLC OR NOT RAYDIX_OPENCL_HEADERS)
    if(RAYDIX_OPENCL STREQUAL "ON")
        message(FATAL_ERROR "RAYDIX_OPENCL=ON needs clang 22 or newer, its llc and the headers of OpenCL (Debian: clang-22 "
            "llvm-22 opencl-c-headers)")
    endif()
    return()
endif()
set(RAYDIX_HAVE_OPENCL ON)

# The host's bits: no contraction. Optimised by clang alone: llc's own passes know less of SPIR-V.
set(raydix_hip_flags -x hip --cuda-device-only -nogpuinc -nogpulib -std=c++20 -O2 -ffp-contract=off ${raydix_kernel_warnings}
    -Wno-unused-function -Wno-unused-private-field -I${CMAKE_CURRENT_SOURCE_DIR}/include -I${CMAKE_CURRENT_SOURCE_DIR}/src)
set(raydix_spirv_folder ${CMAKE_CURRENT_BINARY_DIR}/spirv)
file(MAKE_DIRECTORY ${raydix_spirv_folder})
file(GLOB raydix_kernel_sources CONFIGURE_DEPENDS src/gpu/kernels/*.hip)
set(raydix_spirv_files)
set(raydix_spirv_modules)
foreach(source ${raydix_kernel_sources})
    get_filename_component(name ${source} NAME_WE)
    set(to ${raydix_spirv_folder}/${name})
    # Intel's driver for processors wants lanes that vote to do so in the kernel itself, not in functions that it calls.
    # Kernels without votes it takes for those of one lane if all is inlined.
    set(inlined)
    if(name MATCHES "^(trace_votes|cwbvh)$")
        set(inlined -mllvm -inline-threshold=100000)
    endif()
    add_custom_command(OUTPUT ${to}.spv DEPENDS ${source} DEPFILE ${to}.d
        COMMAND ${RAYDIX_KERNEL_CLANG} ${raydix_hip_flags} ${inlined} --offload=spirv64 -S -emit-llvm
            -Xclang -dependency-file -Xclang ${to}.d -Xclang -MT -Xclang ${to}.spv ${source} -o ${to}.ll
        COMMAND ${RAYDIX_KERNEL_LLC} -O0 -mtriple=spirv64-unknown-unknown -filetype=obj
            --spirv-ext=+SPV_KHR_no_integer_wrap_decoration ${to}.ll -o ${to}.spv
        COMMENT "Kernels of ${name} to SPIR-V" VERBATIM)
    list(APPEND raydix_spirv_files ${to}.spv)
    string(APPEND raydix_spirv_modules " X(${name})")
endforeach()
add_custom_target(raydix_spirv DEPENDS ${raydix_spirv_files})
file(CONFIGURE OUTPUT ${raydix_spirv_folder}/modules.h CONTENT
    "#define RAYDIX_SPIRV_FOLDER \"${raydix_spirv_folder}\"\n#define RAYDIX_SPIRV_MODULES(X)${raydix_spirv_modules}\n" @ONLY)
set_source_files_properties(src/exec/spirv_module.cpp PROPERTIES OBJECT_DEPENDS "${raydix_spirv_files}"
    COMPILE_DEFINITIONS "RAYDIX_HAVE_OPENCL=1;RAYDIX_SPIRV_LIST=\"${raydix_spirv_folder}/modules.h\"")
file(GLOB raydix_opencl_sources src/exec/opencl_*.cpp src/gpu/opencl_*.cpp)
set_source_files_properties(${raydix_opencl_sources} PROPERTIES COMPILE_DEFINITIONS RAYDIX_HAVE_OPENCL=1)
# What launches kernels of any queue; HIP is a second one (RaydixHip.cmake).
file(GLOB raydix_queue_sources src/gpu/queue_*.cpp)
set_source_files_properties(${raydix_queue_sources} PROPERTIES COMPILE_DEFINITIONS RAYDIX_HAVE_QUEUES=1)
