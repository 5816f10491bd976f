target_sources(unit_net PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp" "${PROJECT_SOURCE_DIR}/tests/support/relay_bytes.cpp")
