# The install target: library, headers, a package that find_package(ise) finds, and a .pc file.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
set(ise_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/ise")
# Asio is compiled into the library: whoever uses it compiles against the same one.
set(ISE_ASIO_VERSION "${Asio_VERSION}")

set(ise_installed ise)
if(ISE_WITH_RECORDINGS)
  list(APPEND ise_installed ise_bag ise_replay)
endif()
install(TARGETS ${ise_installed} EXPORT iseTargets
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}"
  INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
# What is in none of these libraries has no headers here either, but for the services that drive an instantiation server.
set(ise_without PATTERN "database" EXCLUDE PATTERN "instantiation" EXCLUDE PATTERN "deployment" EXCLUDE)
if(NOT ISE_WITH_RECORDINGS)
  list(APPEND ise_without PATTERN "bag" EXCLUDE PATTERN "replay" EXCLUDE)
endif()
install(DIRECTORY "${PROJECT_SOURCE_DIR}/ise" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.hpp" ${ise_without})
install(FILES "${PROJECT_SOURCE_DIR}/ise/instantiation/services.hpp" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/ise/instantiation")
install(EXPORT iseTargets NAMESPACE ise:: DESTINATION "${ise_package_dir}")

configure_package_config_file("${PROJECT_SOURCE_DIR}/cmake/iseConfig.cmake.in" "${PROJECT_BINARY_DIR}/package/iseConfig.cmake"
  INSTALL_DESTINATION "${ise_package_dir}")
# Before 1.0 a minor version may break users.
write_basic_package_version_file("${PROJECT_BINARY_DIR}/package/iseConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/package/iseConfig.cmake" "${PROJECT_BINARY_DIR}/package/iseConfigVersion.cmake"
  "${PROJECT_SOURCE_DIR}/cmake/FindAsio.cmake" DESTINATION "${ise_package_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/ise" RENAME copyright
  COMPONENT license)
# The lint of docs/coroutines.md.
install(FILES "${PROJECT_SOURCE_DIR}/tests/lint/coroutine.py" "${PROJECT_SOURCE_DIR}/tests/lint/cpp_tokens.py"
  "${PROJECT_SOURCE_DIR}/tests/lint/cpp_structs.py" DESTINATION "${CMAKE_INSTALL_DATADIR}/ise/coroutine_lint")

# For who builds without CMake: g++ main.cpp $(pkg-config --cflags --libs ise)
get_target_property(definitions ise INTERFACE_COMPILE_DEFINITIONS)
list(TRANSFORM definitions REPLACE "^\\$<.*:([A-Z_]+=[0-9]+)>$" "\\1") # those for clang are true of g++ as well
list(TRANSFORM definitions PREPEND -D)
set(pc_flags ${definitions})
foreach(dependency IN ITEMS asio::asio cereal::cereal) # neither has a .pc file
  get_target_property(folders ${dependency} INTERFACE_INCLUDE_DIRECTORIES)
  foreach(folder IN LISTS folders)
    if(NOT folder MATCHES "\\$<" AND NOT folder IN_LIST CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES)
      list(APPEND pc_flags "-I${folder}")
    endif()
  endforeach()
endforeach()
set(pc_requires "fmt")
if(ISE_FMT_HEADER_ONLY)
  set(pc_requires "")
  list(APPEND pc_flags -DFMT_HEADER_ONLY=1)
endif()
set(pc_private "")
if(ISE_WITH_OPENSSL) # the library is static: whoever links it links these
  set(pc_private "-lssl -lcrypto")
endif()
if(ISE_HTTP_PARSER_INCLUDE_DIR)
  string(APPEND pc_private " -lhttp_parser")
endif()
list(JOIN pc_flags " " pc_flags)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY "${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig" OUTPUT_VARIABLE pc_up)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_LIBDIR BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}" OUTPUT_VARIABLE pc_lib)
cmake_path(RELATIVE_PATH CMAKE_INSTALL_FULL_INCLUDEDIR BASE_DIRECTORY "${CMAKE_INSTALL_PREFIX}" OUTPUT_VARIABLE pc_include)
configure_file("${PROJECT_SOURCE_DIR}/cmake/ise.pc.in" "${PROJECT_BINARY_DIR}/package/ise.pc" @ONLY)
install(FILES "${PROJECT_BINARY_DIR}/package/ise.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
