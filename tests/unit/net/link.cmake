target_sources(unit_net PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp")
