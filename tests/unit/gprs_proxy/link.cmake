target_link_libraries(unit_gprs_proxy PRIVATE atirma_gprs atirma_communication)
target_sources(unit_gprs_proxy PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp")
