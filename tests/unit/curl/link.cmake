find_package(OpenSSL REQUIRED) # for the servers of the tests
target_sources(unit_curl PRIVATE ../support/program.cpp)
target_link_libraries(unit_curl PRIVATE atirma_curl OpenSSL::SSL)
