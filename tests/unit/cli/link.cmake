# The pure parts of the command line; they need no component.
foreach(part activity call_cycles connections cpp_header exit_code findings graph_drawing learning needs packet_lines pattern short_names span_tree spread styled table
             text top_view)
  target_sources(unit_cli PRIVATE "${PROJECT_SOURCE_DIR}/apps/ise/${part}.cpp")
endforeach()
target_link_libraries(unit_cli PRIVATE ise_deployment)
