# The simulated kernels are compiled a second time for processors with AVX2 and FMA; which version
# runs is decided at run time (src/trace/warp/simulated_kernels.cpp).
file(GLOB raydix_simulated CONFIGURE_DEPENDS src/trace/warp/simulated_kernels_[0-9]*.cpp)
if(RAYDIX_SKIP)
    list(FILTER raydix_simulated EXCLUDE REGEX "${RAYDIX_SKIP}")
endif()
if(NOT raydix_simulated)
    return()
endif()
set_source_files_properties(${raydix_simulated} PROPERTIES COMPILE_DEFINITIONS RAYDIX_SIMULATOR_ISA=base)
# Under sanitizers the first version alone: they look at what the source does, which is the same. And one for this
# machine alone, if the build is (cmake/RaydixHost.cmake).
if(raydix_host_options)
    set_source_files_properties(${raydix_simulated} PROPERTIES COMPILE_OPTIONS "${raydix_host_options}"
        SKIP_PRECOMPILE_HEADERS ON)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT RAYDIX_SANITIZE)
    set(raydix_v3_dir ${CMAKE_CURRENT_BINARY_DIR}/simulator_v3)
    set(raydix_simulated_v3)
    foreach(source ${raydix_simulated})
        get_filename_component(name ${source} NAME)
        file(CONFIGURE OUTPUT ${raydix_v3_dir}/${name} CONTENT "#include \"trace/warp/${name}\"\n" @ONLY)
        list(APPEND raydix_simulated_v3 ${raydix_v3_dir}/${name})
    endforeach()
    add_library(raydix_simulator_v3 OBJECT ${raydix_simulated_v3})
    target_include_directories(raydix_simulator_v3 PRIVATE include src)
    target_link_libraries(raydix_simulator_v3 PRIVATE raydix_options)
    # On the files, so that it comes after what every target is compiled with.
    set_source_files_properties(${raydix_simulated_v3} PROPERTIES COMPILE_OPTIONS -march=x86-64-v3)
    target_compile_definitions(raydix_simulator_v3 PRIVATE RAYDIX_SIMULATOR_ISA=v3)
    target_sources(raydix PRIVATE $<TARGET_OBJECTS:raydix_simulator_v3>)
    target_compile_definitions(raydix PRIVATE RAYDIX_SIMULATOR_V3=1)
endif()
