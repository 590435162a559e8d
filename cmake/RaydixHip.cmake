# The kernels of src/gpu/kernels as code objects for AMD's GPUs, one file for each architecture, by the clang that makes SPIR-V of
# them. The library embeds them and opens the HIP runtime when a device is asked for; it links nothing. RAYDIX_HAVE_HIP says
# whether it does. tests/device/code_object_test.py reads what the compiler gave each kernel.
# scripts/code_objects compiles and checks all four that the library is written for.
# A code object takes more than a minute of a processor. AUTO: where tests compile them in any case; ON: in every build.
set(RAYDIX_HIP AUTO CACHE STRING "AUTO, ON or OFF")
set_property(CACHE RAYDIX_HIP PROPERTY STRINGS AUTO ON OFF)
set(RAYDIX_HIP_ARCHITECTURES "gfx90a;gfx1100" CACHE STRING
    "Architectures of AMD whose code objects are compiled and embedded: of gfx90a, gfx942 (64 lanes), gfx1100, gfx1200 (32)")
set(RAYDIX_HAVE_HIP OFF)
set(RAYDIX_CODE_OBJECTS)
if(RAYDIX_HIP STREQUAL "OFF" OR (RAYDIX_HIP STREQUAL "AUTO" AND (NOT RAYDIX_HAVE_OPENCL OR NOT RAYDIX_TESTS OR RAYDIX_SANITIZE)))
    return()
endif()
if(RAYDIX_HAVE_OPENCL)
    find_program(RAYDIX_KERNEL_LLD NAMES ld.lld${raydix_clang_suffix} DOC "lld of the same version")
    find_program(RAYDIX_KERNEL_READELF NAMES llvm-readelf${raydix_clang_suffix} DOC "llvm-readelf of the same version")
endif()
if(NOT RAYDIX_KERNEL_LLD OR NOT RAYDIX_KERNEL_READELF)
    if(RAYDIX_HIP STREQUAL "ON")
        message(FATAL_ERROR "RAYDIX_HIP=ON needs what RAYDIX_OPENCL=ON does, and lld of clang's version (Debian: lld-22)")
    endif()
    message(STATUS "No code objects for AMD: they need lld of clang's version (Debian: lld-22)")
    return()
endif()
set(RAYDIX_HAVE_HIP ON)

# Code objects of version 4, which every ROCm since 5.0 loads. clang's own choice, 6, is refused before 6.3; from 5 on kernels
# ask the runtime for the size of their groups in hidden arguments, which ROCm 5.0 does not write.
set(raydix_code_object_version 4)
# All kernels as one source: most of the time goes to the headers.
set(raydix_code_object_folder ${CMAKE_CURRENT_BINARY_DIR}/code_objects)
set(raydix_all_kernels)
set(raydix_code_object_names)
foreach(source ${raydix_kernel_sources})
    string(APPEND raydix_all_kernels "#include \"${source}\"\n")
endforeach()
file(CONFIGURE OUTPUT ${raydix_code_object_folder}/all.hip CONTENT "${raydix_all_kernels}" @ONLY)
foreach(architecture ${RAYDIX_HIP_ARCHITECTURES})
    set(to ${raydix_code_object_folder}/${architecture})
    # clang 22.1 crashes on merge_clusters where it may use halves of registers.
    set(whole_registers)
    if(architecture MATCHES "^gfx11")
        set(whole_registers -Xclang -target-feature -Xclang -real-true16)
    endif()
    add_custom_command(OUTPUT ${to}.co DEPENDS ${raydix_code_object_folder}/all.hip ${raydix_kernel_sources} DEPFILE ${to}.d
        COMMAND ${RAYDIX_KERNEL_CLANG} ${raydix_hip_flags} ${whole_registers} --offload-arch=${architecture}
            -mcode-object-version=${raydix_code_object_version} --no-gpu-bundle-output
            -fno-crash-diagnostics -Xclang -dependency-file -Xclang ${to}.d -Xclang -MT -Xclang ${to}.co
            -c ${raydix_code_object_folder}/all.hip -o ${to}.co
        COMMENT "Kernels to a code object for ${architecture}" VERBATIM)
    list(APPEND RAYDIX_CODE_OBJECTS ${to}.co)
    string(APPEND raydix_code_object_names " X(${architecture})")
endforeach()
file(CONFIGURE OUTPUT ${raydix_code_object_folder}/list.h CONTENT
    "#define RAYDIX_CODE_OBJECT_FOLDER \"${raydix_code_object_folder}\"\n#define RAYDIX_CODE_OBJECTS(X)${raydix_code_object_names}\n" @ONLY)
file(GLOB raydix_hip_sources src/exec/hip_*.cpp src/gpu/hip_*.cpp)
set_source_files_properties(${raydix_hip_sources} PROPERTIES COMPILE_DEFINITIONS RAYDIX_HAVE_HIP=1)
set_source_files_properties(src/exec/code_object.cpp PROPERTIES OBJECT_DEPENDS "${RAYDIX_CODE_OBJECTS}"
    COMPILE_DEFINITIONS "RAYDIX_HAVE_HIP=1;RAYDIX_CODE_OBJECT_LIST=\"${raydix_code_object_folder}/list.h\"")
add_custom_target(raydix_code_objects ALL DEPENDS ${RAYDIX_CODE_OBJECTS})
