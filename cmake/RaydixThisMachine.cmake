# For builds that no other machine is to run, as pip's are: what nothing here can run is not compiled. That holds for what
# is AUTO; a value that was given stays.
option(RAYDIX_THIS_MACHINE
    "Compile for this machine alone: its best instruction set; CUDA, OpenCL and the Python module for MPI where they can run" OFF)

# out: whether kernels for `what` are left out, since `found` is empty.
function(raydix_nothing_runs out asked what found)
    set(${out} OFF PARENT_SCOPE)
    if(RAYDIX_THIS_MACHINE AND asked STREQUAL "AUTO" AND NOT found)
        message(STATUS "This machine has no ${what}, and the build is for it alone: left out (RAYDIX_THIS_MACHINE=OFF compiles it)")
        set(${out} ON PARENT_SCOPE)
    endif()
endfunction()

set(raydix_nvidia_gpus)
set(raydix_opencl_drivers)
if(RAYDIX_THIS_MACHINE)
    file(GLOB raydix_nvidia_gpus /proc/driver/nvidia/gpus/*)
    execute_process(COMMAND nvidia-smi -L OUTPUT_VARIABLE listed ERROR_QUIET RESULT_VARIABLE failed)
    if(failed EQUAL 0 AND listed MATCHES "GPU")
        list(APPEND raydix_nvidia_gpus "${listed}")
    endif()
    set(folder /etc/OpenCL/vendors)
    if(DEFINED ENV{OCL_ICD_VENDORS})
        set(folder $ENV{OCL_ICD_VENDORS})
    endif()
    file(GLOB raydix_opencl_drivers ${folder}/*.icd)
    if(EXISTS ${folder} AND NOT IS_DIRECTORY ${folder})  # loaders take a single file as well
        set(raydix_opencl_drivers ${folder})
    endif()
endif()
