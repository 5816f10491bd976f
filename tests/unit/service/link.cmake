target_sources(unit_service PRIVATE ../support/relay_bytes.cpp)
