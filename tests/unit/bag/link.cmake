target_link_libraries(unit_bag PRIVATE ise_bag)
