# Manual pages of the Debian packages: each program's and each command's --help. Included after all programs.
find_program(HELP2MAN help2man)
find_program(GZIP gzip)
get_property(programs GLOBAL PROPERTY ISE_INSTALLED_PROGRAMS)
if(HELP2MAN AND GZIP AND (NOT CMAKE_CROSSCOMPILING OR CMAKE_CROSSCOMPILING_EMULATOR))
  foreach(program IN LISTS programs)
    get_target_property(name ${program} OUTPUT_NAME)
    if(NOT name)
      set(name ${program})
    endif()
    get_target_property(component ${program} ISE_PACKAGE)
    get_target_property(description ${program} ISE_DESCRIPTION)
    set(pages "${PROJECT_BINARY_DIR}/package/man/${name}")
    add_custom_command(OUTPUT "${pages}/${name}.1.gz"
      COMMAND "${CMAKE_CURRENT_LIST_DIR}/manual-pages" "$<TARGET_FILE:${program}>" "${description}" "${pages}"
        ${CMAKE_CROSSCOMPILING_EMULATOR}
      DEPENDS ${program} "${CMAKE_CURRENT_LIST_DIR}/manual-pages" VERBATIM)
    list(APPEND all_pages "${pages}/${name}.1.gz")
    install(DIRECTORY "${pages}/" DESTINATION "${CMAKE_INSTALL_MANDIR}/man1" COMPONENT ${component} EXCLUDE_FROM_ALL)
  endforeach()
  add_custom_target(manual_pages ALL DEPENDS ${all_pages})
else()
  message(STATUS "no manual pages: help2man is missing, or what runs the programs here")
endif()
# What is in the packages, and no more.
add_custom_target(packaged DEPENDS ${all_pages})
add_dependencies(packaged ${ise_installed} ${programs})
