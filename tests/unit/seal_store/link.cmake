find_package(SQLite3 REQUIRED)
target_link_libraries(unit_seal_store PRIVATE atirma_seal_store SQLite::SQLite3)
