# The kernels of src/gpu/kernels as code objects for AMD's GPUs, one file for each architecture, by the clang that makes SPIR-V of
# them. Nothing loads them yet: tests/device/code_object_test.py reads what the compiler gave each kernel.
# scripts/code_objects compiles and checks all four that the library is written for.
set(RAYDIX_HIP_ARCHITECTURES "gfx90a;gfx1100" CACHE STRING
    "Architectures of AMD whose code objects are compiled and checked by tests: of gfx90a, gfx942 (64 lanes), gfx1100, gfx1200 (32)")
set(RAYDIX_CODE_OBJECTS)
if(NOT RAYDIX_HAVE_OPENCL OR NOT RAYDIX_TESTS OR RAYDIX_SANITIZE)
    return()
endif()
find_program(RAYDIX_KERNEL_LLD NAMES ld.lld${raydix_clang_suffix} DOC "lld of the same version")
find_program(RAYDIX_KERNEL_READELF NAMES llvm-readelf${raydix_clang_suffix} DOC "llvm-readelf of the same version")
if(NOT RAYDIX_KERNEL_LLD OR NOT RAYDIX_KERNEL_READELF)
    message(STATUS "No code objects for AMD: they need lld of clang's version (Debian: lld-22)")
    return()
endif()

# All kernels as one source: most of the time goes to the headers.
set(raydix_code_object_folder ${CMAKE_CURRENT_BINARY_DIR}/code_objects)
set(raydix_all_kernels)
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
        COMMAND ${RAYDIX_KERNEL_CLANG} ${raydix_hip_flags} ${whole_registers} --offload-arch=${architecture} --no-gpu-bundle-output
            -fno-crash-diagnostics -Xclang -dependency-file -Xclang ${to}.d -Xclang -MT -Xclang ${to}.co
            -c ${raydix_code_object_folder}/all.hip -o ${to}.co
        COMMENT "Kernels to a code object for ${architecture}" VERBATIM)
    list(APPEND RAYDIX_CODE_OBJECTS ${to}.co)
endforeach()
add_custom_target(raydix_code_objects ALL DEPENDS ${RAYDIX_CODE_OBJECTS})
