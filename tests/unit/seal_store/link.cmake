find_package(SQLite3 REQUIRED)
target_link_libraries(unit_seal_store PRIVATE atirma_seal SQLite::SQLite3)
