find_package(nlohmann_json REQUIRED)
find_package(OpenSSL REQUIRED)
target_link_libraries(unit_iridium PRIVATE atirma_iridium atirma_iridium_gateway nlohmann_json::nlohmann_json OpenSSL::Crypto)
