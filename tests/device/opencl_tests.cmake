# Tests on an OpenCL device. Each program is one test: drivers compile a module of kernels once a process. Where
# scripts/setup --test has put Intel's driver for processors into build/opencl-rt they run on that; elsewhere on what the
# system's loader finds.
add_executable(device_opencl opencl_builds.cpp)
target_link_libraries(device_opencl PRIVATE raydix_test_support GTest::gtest_main)

set(raydix_opencl_environment RAYDIX_TEST_DEVICE=opencl)
set(raydix_opencl_rt ${PROJECT_SOURCE_DIR}/build/opencl-rt/lib)
if(EXISTS ${raydix_opencl_rt}/libintelocl.so)
    file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/opencl_vendors/intel.icd CONTENT "${raydix_opencl_rt}/libintelocl.so\n")
    # It is newer than the system's oneTBB.
    list(APPEND raydix_opencl_environment OCL_ICD_VENDORS=${CMAKE_BINARY_DIR}/opencl_vendors
        LD_LIBRARY_PATH=${raydix_opencl_rt})
endif()
foreach(test opencl:device_opencl opencl_trace:device_gpu_trace)
    string(REPLACE ":" ";" test ${test})
    list(GET test 0 name)
    list(GET test 1 program)
    add_test(NAME device.${name} COMMAND ${program})
    set_tests_properties(device.${name} PROPERTIES LABELS device TIMEOUT 900 SKIP_REGULAR_EXPRESSION "PASSED  . 0 tests"
        ENVIRONMENT "${raydix_opencl_environment}")
endforeach()
if(RAYDIX_CLI)
    find_package(Python3 REQUIRED COMPONENTS Interpreter)
    add_test(NAME device.measured COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/measured_test.py)
    set_tests_properties(device.measured PROPERTIES LABELS device TIMEOUT 300 SKIP_REGULAR_EXPRESSION "skipped="
        ENVIRONMENT "RAYDIX_PROGRAM=$<TARGET_FILE:raydix_cli>;${raydix_opencl_environment}")
endif()
# How a process ends that has left work on a device.
add_executable(device_opencl_exit opencl_exit.cpp)
target_link_libraries(device_opencl_exit PRIVATE raydix)
add_test(NAME device.opencl_exit COMMAND device_opencl_exit)
set_tests_properties(device.opencl_exit PROPERTIES LABELS device TIMEOUT 120 SKIP_RETURN_CODE 77
    ENVIRONMENT "${raydix_opencl_environment}")
# HIP over a stand-in for AMD's runtime, which executes on the same driver.
if(RAYDIX_HAVE_HIP)
    add_library(device_standin_hip SHARED standin/hip_runtime.cpp standin/code_object_reader.cpp)
    target_include_directories(device_standin_hip PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
    target_link_libraries(device_standin_hip PRIVATE raydix)
    target_link_options(device_standin_hip PRIVATE -Wl,--exclude-libs,ALL)
    set_target_properties(device_standin_hip PROPERTIES OUTPUT_NAME amdhip64 CXX_STANDARD 20
        LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/standin)
    add_executable(device_hip hip_standin.cpp)
    target_link_libraries(device_hip PRIVATE raydix_test_support GTest::gtest_main)
    add_dependencies(device_hip device_standin_hip)
    set(raydix_hip_environment ${raydix_opencl_environment})
    list(FILTER raydix_hip_environment EXCLUDE REGEX "^LD_LIBRARY_PATH=")
    add_test(NAME device.hip COMMAND device_hip)
    set_tests_properties(device.hip PROPERTIES LABELS device TIMEOUT 900 SKIP_REGULAR_EXPRESSION "PASSED  . 0 tests"
        ENVIRONMENT "${raydix_hip_environment};LD_LIBRARY_PATH=${CMAKE_CURRENT_BINARY_DIR}/standin:${raydix_opencl_rt}")
endif()
