# Manual pages of the Debian packages: each program's --help. Included after all programs.
find_program(HELP2MAN help2man)
find_program(GZIP gzip)
if(HELP2MAN AND GZIP AND NOT CMAKE_CROSSCOMPILING)
  get_property(programs GLOBAL PROPERTY ISE_INSTALLED_PROGRAMS)
  foreach(program IN LISTS programs)
    get_target_property(name ${program} OUTPUT_NAME)
    if(NOT name)
      set(name ${program})
    endif()
    get_target_property(component ${program} ISE_PACKAGE)
    get_target_property(description ${program} ISE_DESCRIPTION)
    set(page "${PROJECT_BINARY_DIR}/package/man/${name}.1")
    add_custom_command(OUTPUT "${page}.gz"
      COMMAND "${CMAKE_COMMAND}" -E make_directory "${PROJECT_BINARY_DIR}/package/man"
      COMMAND "${HELP2MAN}" --no-info --name "${description}" --output "${page}" $<TARGET_FILE:${program}>
      COMMAND "${GZIP}" --best --no-name --force "${page}"
      DEPENDS ${program} VERBATIM)
    list(APPEND pages "${page}.gz")
    install(FILES "${page}.gz" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" COMPONENT ${component} EXCLUDE_FROM_ALL)
  endforeach()
  add_custom_target(manual_pages ALL DEPENDS ${pages})
else()
  message(STATUS "no manual pages: help2man is missing")
endif()
