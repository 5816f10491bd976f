find_package(nlohmann_json REQUIRED)
target_sources(unit_nmea_bridge PRIVATE ../support/program.cpp)
target_link_libraries(unit_nmea_bridge PRIVATE atirma_nmea_bridge nlohmann_json::nlohmann_json)
