target_sources(unit_name_server PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp")
