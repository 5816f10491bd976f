# The install target: library, headers, and a package that find_package(ise) finds.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(ise_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/ise")
set(ISE_ASIO_MINIMUM 1.22)

install(TARGETS ise EXPORT iseTargets
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}"
  INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/ise" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.hpp")
install(EXPORT iseTargets NAMESPACE ise:: DESTINATION "${ise_package_dir}")

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/iseConfig.cmake.in" "${PROJECT_BINARY_DIR}/package/iseConfig.cmake"
  INSTALL_DESTINATION "${ise_package_dir}")
# Before 1.0 a minor version may break users.
write_basic_package_version_file("${PROJECT_BINARY_DIR}/package/iseConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/package/iseConfig.cmake" "${PROJECT_BINARY_DIR}/package/iseConfigVersion.cmake"
  "${PROJECT_SOURCE_DIR}/cmake/FindAsio.cmake" DESTINATION "${ise_package_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/ise" RENAME copyright)
