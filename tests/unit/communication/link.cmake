find_package(SQLite3 REQUIRED) # the tests change files behind the store's back
target_link_libraries(unit_communication PRIVATE atirma_communication SQLite::SQLite3)
