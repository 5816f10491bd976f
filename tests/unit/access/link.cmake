target_sources(unit_access PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp")
