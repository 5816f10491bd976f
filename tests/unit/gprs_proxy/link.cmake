target_link_libraries(unit_gprs_proxy PRIVATE atirma_gprs_proxy atirma_gprs_link atirma_communication)
target_sources(unit_gprs_proxy PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/authority.cpp")
