# Configures, builds and runs consumer/ against an installed raydix (find_package), one that was built as a shared library
# (shared), or its sources, without oneTBB (add_subdirectory). consumer_c/ does the same in C against what is installed,
# consumer_without/ looks for it where pkg-config finds no libraries.
function(run_step what)
    execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT status EQUAL 0)
        message(FATAL_ERROR "${what}: exit code ${status}\n${output}")
    endif()
    set(last_output "${output}" PARENT_SCOPE)
endfunction()

# Runs the program and compares what it prints.
function(run_program program expected)
    run_step("run ${program}" ${program})
    if(NOT last_output STREQUAL "${expected}\n")
        message(FATAL_ERROR "${program} printed: ${last_output}")
    endif()
endfunction()

# The program in C, by find_package and by pkg-config.
function(run_consumer_c)
    run_step("configure C" ${CMAKE_COMMAND} -G ${GENERATOR} -S ${CMAKE_CURRENT_LIST_DIR}/consumer_c -B ${WORK_DIR}/build_c
        -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
    run_step("build C" ${CMAKE_COMMAND} --build ${WORK_DIR}/build_c)
    run_program(${WORK_DIR}/build_c/consumer "triangle 0 at t = 2")
    file(GLOB_RECURSE package ${WORK_DIR}/prefix/raydix_c.pc)
    get_filename_component(folder "${package}" DIRECTORY)
    set(ENV{PKG_CONFIG_PATH} ${folder})
    run_step("pkg-config" pkg-config --cflags --libs raydix_c)
    string(STRIP "${last_output}" flags)
    separate_arguments(flags UNIX_COMMAND "${flags}")
    file(GLOB_RECURSE library ${WORK_DIR}/prefix/libraydix_c.so)
    get_filename_component(folder "${library}" DIRECTORY)
    run_step("cc" cc -std=c99 -Wall -Wextra -Wpedantic -Werror ${CMAKE_CURRENT_LIST_DIR}/consumer_c/main.c
        -o ${WORK_DIR}/with_pkg_config ${flags} -Wl,-rpath,${folder})
    run_program(${WORK_DIR}/with_pkg_config "triangle 0 at t = 2")
endfunction()

set(installed_from ${RAYDIX_BINARY_DIR})
if(VARIANT STREQUAL "shared")
    # Beside the build that tests it and with its flags, so that a compiler cache knows nearly every object. It knows none of
    # the devices' kernels.
    set(installed_from ${RAYDIX_BINARY_DIR}-shared)
    run_step("configure shared" ${CMAKE_COMMAND} -G ${GENERATOR} -S ${RAYDIX_SOURCE_DIR} -B ${installed_from}
        -D CMAKE_BUILD_TYPE=${BUILD_TYPE} -D CMAKE_CXX_COMPILER=${COMPILER} -D BUILD_SHARED_LIBS=ON -D RAYDIX_TESTS=OFF
        -D RAYDIX_BENCH=OFF -D RAYDIX_CUDA=OFF -D RAYDIX_OPENCL=OFF -D RAYDIX_MPI=OFF)
    run_step("build shared" ${CMAKE_COMMAND} --build ${installed_from} --parallel 2)
endif()
file(REMOVE_RECURSE ${WORK_DIR}/prefix ${WORK_DIR}/prefix_before)
set(arguments -D CMAKE_BUILD_TYPE=${BUILD_TYPE} -D CMAKE_CXX_COMPILER=${COMPILER} -D VARIANT=${VARIANT})
set(threads "oneTBB: yes")
if(LAUNCHER)
    list(APPEND arguments -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
endif()
if(NOT VARIANT STREQUAL "add_subdirectory")
    run_step("install" ${CMAKE_COMMAND} --install ${installed_from} --prefix ${WORK_DIR}/prefix_before)
    # Moved after it was installed: the package must not remember where it was.
    file(RENAME ${WORK_DIR}/prefix_before ${WORK_DIR}/prefix)
    file(GLOB_RECURSE installed ${WORK_DIR}/prefix/*.cmake)
    foreach(file ${installed})
        file(READ ${file} text)
        string(FIND "${text}" "${RAYDIX_SOURCE_DIR}" position)
        if(NOT position EQUAL -1)
            message(FATAL_ERROR "${file} refers to the source tree")
        endif()
    endforeach()
    list(APPEND arguments -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
    file(REMOVE_RECURSE ${WORK_DIR}/build)
else()
    # What the consumer has no need of is left out, and nothing is quicker to compile than without optimisation.
    set(threads "oneTBB: no")
    list(APPEND arguments -D RAYDIX_TBB=OFF -D RAYDIX_SOURCE_DIR=${RAYDIX_SOURCE_DIR} -D RAYDIX_CUDA=OFF -D RAYDIX_OPENCL=OFF
        -D RAYDIX_MPI=OFF -D CMAKE_BUILD_TYPE=Debug
        -D CMAKE_CXX_FLAGS_DEBUG=-O0 -D RAYDIX_INSTRUCTION_SETS=ONE
        "-DRAYDIX_SKIP=/src/(engine|gpu|image|io|measure|points|proximity|report|scene|simt)/|/src/trace/(simd|warp)/")
endif()
run_step("configure" ${CMAKE_COMMAND} -G ${GENERATOR} -S ${CMAKE_CURRENT_LIST_DIR}/consumer -B ${WORK_DIR}/build
    ${arguments})
run_step("build" ${CMAKE_COMMAND} --build ${WORK_DIR}/build --parallel 2)
run_program(${WORK_DIR}/build/consumer "triangle 0 at t = 2")
run_program(${WORK_DIR}/build/consumer_threads "${threads}")
if(VARIANT STREQUAL "shared")
    file(GLOB_RECURSE shared ${WORK_DIR}/prefix/libraydix.so)
    if(NOT shared)
        message(FATAL_ERROR "no libraydix.so was installed")
    endif()
    run_step("the installed program" ${WORK_DIR}/prefix/bin/raydix --version)
endif()
if(NOT VARIANT STREQUAL "add_subdirectory")
    run_consumer_c()
    run_step("configure without libraries" ${CMAKE_COMMAND} -E env PKG_CONFIG_LIBDIR=${WORK_DIR} --unset=PKG_CONFIG_PATH
        ${CMAKE_COMMAND} -G ${GENERATOR} -S ${CMAKE_CURRENT_LIST_DIR}/consumer_without -B ${WORK_DIR}/build_without
        ${arguments})
endif()
