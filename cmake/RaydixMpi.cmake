# raydix_mpi, a library beside raydix: scenes and points spread over the ranks of MPI. Everything else builds without.
set(RAYDIX_HAVE_MPI OFF)
if(NOT RAYDIX_MPI MATCHES "^(AUTO|ON|OFF)$")
    message(FATAL_ERROR "RAYDIX_MPI is AUTO, ON or OFF, not ${RAYDIX_MPI}")
endif()
# The thread sanitizer reports what the MPI library itself shares; a cross compiler would find the host's library.
if(RAYDIX_MPI STREQUAL "OFF" OR (RAYDIX_MPI STREQUAL "AUTO" AND (RAYDIX_SANITIZE MATCHES "thread" OR CMAKE_CROSSCOMPILING)))
    return()
endif()
if(RAYDIX_PYTHON AND RAYDIX_THIS_MACHINE)  # -I: where pip isolates a build, it shows the interpreter's own packages too
    find_package(Python 3.10 REQUIRED COMPONENTS Interpreter)
    execute_process(COMMAND ${Python_EXECUTABLE} -I -c "import importlib.util as u; print(u.find_spec('mpi4py') or '', end='')"
        OUTPUT_VARIABLE raydix_mpi4py ERROR_QUIET)
    raydix_nothing_runs(raydix_no_mpi4py "${RAYDIX_MPI}" mpi4py "${raydix_mpi4py}")
    if(raydix_no_mpi4py)
        return()
    endif()
endif()
set(MPI_CXX_SKIP_MPICXX ON)  # the C calls alone
find_package(MPI COMPONENTS CXX)
if(NOT MPI_CXX_FOUND)
    if(RAYDIX_MPI STREQUAL "ON")
        message(FATAL_ERROR "RAYDIX_MPI is ON, but CMake finds no MPI (Debian: libopenmpi-dev openmpi-bin)")
    endif()
    message(STATUS "No MPI found: raydix_mpi is not built")
    return()
endif()
set(RAYDIX_HAVE_MPI ON)
file(GLOB raydix_mpi_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/mpi/*.cpp)
add_library(raydix_mpi STATIC ${raydix_mpi_sources})
set_target_properties(raydix_mpi PROPERTIES EXPORT_NAME mpi)
raydix_unity(raydix_mpi 6)
if(NOT RAYDIX_TOP_LEVEL AND NOT RAYDIX_INSTALL)  # another project builds it if it links it
    set_target_properties(raydix_mpi PROPERTIES EXCLUDE_FROM_ALL ON)
endif()
add_library(raydix::mpi ALIAS raydix_mpi)
target_include_directories(raydix_mpi PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(raydix_mpi PUBLIC raydix MPI::MPI_CXX
    PRIVATE $<BUILD_INTERFACE:raydix_options> $<BUILD_INTERFACE:fmt::fmt> $<BUILD_INTERFACE:PkgConfig::XXHASH>)
