find_package(nlohmann_json REQUIRED)
target_link_libraries(unit_gui_client PRIVATE atirma_gui_client atirma_web nlohmann_json::nlohmann_json) # page and console: one rule of freshness
