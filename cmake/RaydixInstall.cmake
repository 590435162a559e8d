# find_package(raydix) after `cmake --install`.
include(CMakePackageConfigHelpers)
install(TARGETS raydix EXPORT raydixTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/raydix DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
if(RAYDIX_HAVE_MPI)  # apart, so that programs without MPI do not look for one
    install(TARGETS raydix_mpi EXPORT raydixMpiTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
    install(EXPORT raydixMpiTargets NAMESPACE raydix:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
endif()
install(EXPORT raydixTargets NAMESPACE raydix:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
configure_package_config_file(cmake/raydixConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/raydixConfig.cmake
    INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/raydixConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/raydixConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/raydixConfigVersion.cmake
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
