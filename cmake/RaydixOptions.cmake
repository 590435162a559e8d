# result: the compiler option -OPTION=list, a file, as a path that is the same in every build folder. The compiler runs in
# the build folder; the name there changes with what the list says, so that whatever was compiled with another is
# compiled again and a compiler cache knows it apart.
function(raydix_list_option result option list)
    file(SHA256 "${list}" hash)
    string(SUBSTRING ${hash} 0 12 hash)
    get_filename_component(name "${list}" NAME_WE)
    set(copy ${name}-${hash}.txt)
    configure_file("${list}" "${CMAKE_BINARY_DIR}/${copy}" COPYONLY)
    set(${result} -${option}=${copy} PARENT_SCOPE)
endfunction()

# Warnings: developers see them, in CI they are errors. Whoever only builds the library has another compiler than we do, with
# other warnings, and can do nothing about them; without them GCC takes a fortieth less time.
set(raydix_warnings_default OFF)
if(DEFINED ENV{RAYDIX_WARNINGS})
    set(raydix_warnings_default $ENV{RAYDIX_WARNINGS})
elseif(RAYDIX_TESTS)
    set(raydix_warnings_default ON)
endif()
set(RAYDIX_WARNINGS ${raydix_warnings_default} CACHE STRING
    "Warnings of the compilers: OFF, ON or ERROR; the environment's RAYDIX_WARNINGS is the default")
set_property(CACHE RAYDIX_WARNINGS PROPERTY STRINGS OFF ON ERROR)
set(raydix_warnings)
set(raydix_kernel_warnings)  # of kernels for OpenCL and HIP
set(raydix_cuda_warnings)
if(RAYDIX_WARNINGS)
    set(raydix_warnings -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
    set(raydix_kernel_warnings -Wall -Wextra)
endif()
if(RAYDIX_WARNINGS STREQUAL "ERROR")
    list(APPEND raydix_warnings -Werror)
    list(APPEND raydix_kernel_warnings -Werror)
    set(raydix_cuda_warnings -Werror=all-warnings)
endif()

# What every target of this project is compiled with.
# - No contraction: keys, boxes and hits must have the same bits on every path (docs/architecture.md).
# - x86-64-v2 is the oldest processor that the library promises to run on.
add_library(raydix_options INTERFACE)
target_compile_features(raydix_options INTERFACE cxx_std_20)
target_compile_options(raydix_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:${raydix_warnings} -ffp-contract=off -fno-math-errno -fno-trapping-math>)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(raydix_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-march=x86-64-v2>)
endif()
# GCC looks for memory to give back each time it has taken 128 MB. With 512 MB it does so less often: a tenth of its time,
# for up to 1 GB a job in place of 0.8. Ninja runs two jobs more than there are cores.
cmake_host_system_information(RESULT raydix_host_memory_mb QUERY TOTAL_PHYSICAL_MEMORY)
cmake_host_system_information(RESULT raydix_host_cores QUERY NUMBER_OF_LOGICAL_CORES)
math(EXPR raydix_wanted_mb "1500 * (${raydix_host_cores} + 2)")
if(raydix_host_memory_mb GREATER_EQUAL raydix_wanted_mb)
    set(raydix_gcc_memory --param=ggc-min-expand=100 --param=ggc-min-heapsize=524288)
    target_compile_options(raydix_options INTERFACE
        $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CXX_COMPILER_ID:GNU>>:${raydix_gcc_memory}>)
endif()
if(RAYDIX_SANITIZE)
    target_compile_options(raydix_options INTERFACE
        $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${RAYDIX_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all>)
    # GCC's documentation of -fsanitize: with it, the analysis of uninitialised values reports places that are not.
    target_compile_options(raydix_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
    if(RAYDIX_SANITIZE MATCHES "undefined" AND CMAKE_CXX_COMPILER_ID MATCHES "Clang")
        raydix_list_option(raydix_ignored fsanitize-ignorelist "${CMAKE_CURRENT_LIST_DIR}/sanitizers_ignored.txt")
        target_compile_options(raydix_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:${raydix_ignored}>)
    endif()
    target_link_options(raydix_options INTERFACE -fsanitize=${RAYDIX_SANITIZE})
    find_program(RAYDIX_LLD ld.lld DOC "A linker that takes a third of the time")
    if(RAYDIX_LLD AND CMAKE_CXX_COMPILER_ID MATCHES "Clang")
        target_link_options(raydix_options INTERFACE -fuse-ld=lld)
    endif()
    target_compile_definitions(raydix_options INTERFACE RAYDIX_CHECKS=1 RAYDIX_SANITIZED=1)
elseif(CMAKE_BUILD_TYPE STREQUAL "Debug")
    target_compile_definitions(raydix_options INTERFACE RAYDIX_CHECKS=1)
endif()

# What the program `raydix` is hardened with in release builds. The library is not: rays would pay.
# tests/structure/check_hardening.py looks.
set(raydix_hardened_compile)
set(raydix_hardened_link)
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND NOT RAYDIX_SANITIZE)
    set(raydix_hardened_compile -fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2)
    set(raydix_hardened_link -pie -Wl,-z,relro -Wl,-z,now -Wl,-z,noexecstack)
endif()
