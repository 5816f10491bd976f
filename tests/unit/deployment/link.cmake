if(TARGET ise_deployment)
  target_link_libraries(unit_deployment PRIVATE ise_deployment)
endif()
