# The pure parts of the command line; they need no component.
foreach(part activity connections cpp_header exit_code findings packet_lines pattern spread table text)
  target_sources(unit_cli PRIVATE "${PROJECT_SOURCE_DIR}/apps/ise/${part}.cpp")
endforeach()
target_link_libraries(unit_cli PRIVATE ise_deployment)
