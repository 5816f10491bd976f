# Debian packages by `cpack` in the build folder: libise-dev (the library is static) and ise-tools (the programs).
# The preset `package` builds them with the folders of a Debian system.
set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL development tools)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_PACKAGE_CONTACT "The maintainers of ISE <maintainers@ise.invalid>" CACHE STRING "Maintainer of the packages")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "coroutine middleware for robots")
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libise-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Components of a robot that talk through typed services: C++20, on Asio.
Here are the headers, the static library, and what finds them by CMake and
pkg-config.")
string(REGEX MATCH "^([0-9]+\\.[0-9]+)\\.([0-9]+)" _ "${Asio_VERSION}")
math(EXPR asio_next "${CMAKE_MATCH_2} + 1")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libasio-dev (>= 1:${Asio_VERSION}), libasio-dev (<< 1:${CMAKE_MATCH_1}.${asio_next}), libcereal-dev, libfmt-dev")
if(ISE_WITH_OPENSSL)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", libssl-dev")
endif()
if(ISE_HTTP_PARSER_INCLUDE_DIR)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", libhttp-parser-dev")
endif()

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME ise-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION net)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "Components of a robot that talk through typed services. Here are the command
line ise, which sees and drives running components, and the servers that a
system of components needs.")

# What Debian wants beside every package; not part of an installation.
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC) # of SOURCE_DATE_EPOCH where it is set
foreach(component IN ITEMS DEVELOPMENT TOOLS)
  set(package "${CPACK_DEBIAN_${component}_PACKAGE_NAME}")
  string(TOLOWER "${component}" component)
  set(folder "${PROJECT_BINARY_DIR}/package/${package}")
  file(CONFIGURE OUTPUT "${folder}/changelog.Debian" CONTENT
"ise (@PROJECT_VERSION@-@CPACK_DEBIAN_PACKAGE_RELEASE@) unstable; urgency=medium

  * Built from the sources of ISE @PROJECT_VERSION@.

 -- @CPACK_PACKAGE_CONTACT@  @now@
" @ONLY)
  file(ARCHIVE_CREATE OUTPUT "${folder}/changelog.Debian.gz" PATHS "${folder}/changelog.Debian" FORMAT raw
    COMPRESSION GZip COMPRESSION_LEVEL 9)
  file(CONFIGURE OUTPUT "${folder}/copyright" CONTENT
"Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: ISE

Files: *
Copyright: 2026 the authors of ISE
License: Apache-2.0
 On Debian systems the complete text of the Apache License, version 2.0, is in
 /usr/share/common-licenses/Apache-2.0.
" @ONLY)
  install(FILES "${folder}/changelog.Debian.gz" "${folder}/copyright"
    DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/${package}" COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
