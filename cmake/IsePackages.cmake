# Debian packages by `cpack` in the build folder: libise-dev (the library is static), ise-tools (the programs), atirma (the sailboat's
# shore side) and atirma-console (its windows). The preset `package` builds them with the folders of a Debian system.
set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL development tools)
if(ISE_BUILD_APPS)
  list(APPEND CPACK_COMPONENTS_ALL atirma)
  find_package(Qt6 6.4 QUIET COMPONENTS Widgets)
  if(Qt6Widgets_FOUND)
    list(APPEND CPACK_COMPONENTS_ALL console)
  endif()
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_PACKAGE_CONTACT "The maintainers of ISE <maintainers@ise.invalid>" CACHE STRING "Maintainer of the packages")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "coroutine middleware for robots")
set(CPACK_STRIP_FILES ON)
if(ISE_ARM) # cmake/toolchains/arm.cmake
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE "${ISE_ARM}")
endif()
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
if(ISE_WITH_RECORDINGS)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", libzstd-dev, liblz4-dev, zlib1g-dev")
endif()

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME ise-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION net)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "Components of a robot that talk through typed services. Here are the command
line ise, which sees and drives running components, and the servers that a
system of components needs.")

set(CPACK_DEBIAN_ATIRMA_PACKAGE_NAME atirma)
set(CPACK_DEBIAN_ATIRMA_PACKAGE_SECTION science)
set(CPACK_DEBIAN_ATIRMA_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_ATIRMA_PACKAGE_DEPENDS "ise-tools (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(CPACK_DEBIAN_ATIRMA_DESCRIPTION "Shore side of the autonomous sailboat A-Tirma.
Proxies of its links by radio, GPRS and Iridium, communication nodes, tracking
page, and a simulated boat.")

set(CPACK_DEBIAN_CONSOLE_PACKAGE_NAME atirma-console)
set(CPACK_DEBIAN_CONSOLE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_CONSOLE_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_CONSOLE_PACKAGE_DEPENDS fonts-dejavu-core)
set(CPACK_DEBIAN_CONSOLE_DESCRIPTION "Operator's console of the autonomous sailboat A-Tirma.
Chart, telemetry, missions, telecommands and alarms in windows.")

# Services run as users of their own, which the packages make; nothing is enabled or started by installing.
set(CPACK_DEBIAN_TOOLS_PACKAGE_CONTROL_EXTRA "${PROJECT_BINARY_DIR}/package/ise-tools/postinst")
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS systemd)

# What Debian wants beside every package; not part of an installation.
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC) # of SOURCE_DATE_EPOCH where it is set
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER "${component}" component)
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

file(CONFIGURE OUTPUT "${PROJECT_BINARY_DIR}/package/ise-tools/postinst" CONTENT
[=[#!/bin/sh
set -e
if [ "$1" = configure ]; then
    if command -v systemd-sysusers >/dev/null; then systemd-sysusers ise.conf; fi
    if [ -d /run/systemd/system ]; then systemctl daemon-reload; fi
fi
]=] @ONLY)
file(CHMOD "${PROJECT_BINARY_DIR}/package/ise-tools/postinst" PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(units "${PROJECT_SOURCE_DIR}/apps/systemd")
install(FILES "${units}/ise-name-server.service" "${units}/ise-instantiation-server.service" DESTINATION lib/systemd/system
  COMPONENT tools EXCLUDE_FROM_ALL)
install(FILES "${units}/ise.sysusers" DESTINATION lib/sysusers.d RENAME ise.conf COMPONENT tools EXCLUDE_FROM_ALL)
install(PROGRAMS "${PROJECT_SOURCE_DIR}/apps/pacemaker/component" DESTINATION lib/ocf/resource.d/ise COMPONENT tools EXCLUDE_FROM_ALL)
install(FILES "${units}/ise-page.service" DESTINATION lib/systemd/system COMPONENT atirma EXCLUDE_FROM_ALL)
# Whoever installs the middleware does not want a boat: `cmake --install` leaves it out.
if(ISE_BUILD_APPS)
  install(FILES "${PROJECT_SOURCE_DIR}/apps/atirma/atirma.toml" "${PROJECT_SOURCE_DIR}/apps/atirma/access.toml"
    "${PROJECT_SOURCE_DIR}/apps/atirma/fleet.toml" "${PROJECT_SOURCE_DIR}/apps/atirma/mqtt.toml"
    "${PROJECT_SOURCE_DIR}/apps/atirma/postgresql.toml" DESTINATION "${CMAKE_INSTALL_DATADIR}/atirma" COMPONENT atirma EXCLUDE_FROM_ALL)
endif()
# The folder from which the instantiation server's unit starts programs.
function(ise_startable component)
  foreach(program IN LISTS ARGN)
    set(link "${PROJECT_BINARY_DIR}/package/programs/${program}")
    file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/package/programs")
    file(CREATE_LINK "../../../bin/${program}" "${link}" SYMBOLIC)
    install(FILES "${link}" DESTINATION lib/ise/programs COMPONENT ${component} EXCLUDE_FROM_ALL)
  endforeach()
endfunction()
ise_startable(tools ise_recorder ise_foxglove_gateway ise_mqtt_bridge)
ise_startable(atirma atirma)
include(CPack)
