if(TARGET ise_instantiation)
  target_link_libraries(unit_instantiation PRIVATE ise_instantiation)
endif()
