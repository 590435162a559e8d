# find_package(raydix) after `cmake --install`.
include(CMakePackageConfigHelpers)
install(TARGETS raydix EXPORT raydixTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/raydix DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT raydixTargets NAMESPACE raydix:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
configure_package_config_file(cmake/raydixConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/raydixConfig.cmake
    INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/raydixConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/raydixConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/raydixConfigVersion.cmake
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/raydix)
