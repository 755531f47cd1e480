# Programs that convert the map to messages of other packages, each built if that package is found (not in Debian).
function(situation_awareness_bridge package)
  find_package(${package} QUIET)
  if(NOT ${package}_FOUND)
    message(STATUS "${package} not found: no ${package}_bridge")
    return()
  endif()
  add_executable(${package}_bridge src/ros/nodes/${package}_bridge.cpp)
  situation_awareness_target(${package}_bridge)
  target_include_directories(${package}_bridge SYSTEM PRIVATE ${${package}_INCLUDE_DIRS} ${catkin_INCLUDE_DIRS}
    ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_INCLUDE_DESTINATION})
  target_link_libraries(${package}_bridge PRIVATE ${catkin_LIBRARIES} Eigen3::Eigen)
  add_dependencies(${package}_bridge ${PROJECT_NAME}_generate_messages_cpp ${catkin_EXPORTED_TARGETS}
    ${${package}_EXPORTED_TARGETS})
  set_target_properties(${package}_bridge PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${situation_awareness_node_dir})
  install(TARGETS ${package}_bridge RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

situation_awareness_bridge(costmap_converter)
situation_awareness_bridge(obstacle_detector)
