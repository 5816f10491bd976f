# The pure parts of the command line; they need no component.
foreach(part connections findings findings_services rates service_activity spread table text waits)
  target_sources(unit_cli PRIVATE "${PROJECT_SOURCE_DIR}/apps/ise/${part}.cpp")
endforeach()
target_link_libraries(unit_cli PRIVATE ise_deployment)
