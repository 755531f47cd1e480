# The rviz plugins: a display of the map and a panel. Their logic without Ogre and Qt is a separate library, for the
# tests.
if(NOT rviz_FOUND)
  message(FATAL_ERROR "SITUATION_AWARENESS_RVIZ is ON, but rviz was not found")
endif()
# A plugin that is built with another Qt than rviz ends it: rviz loads it all the same.
string(REGEX MATCH "^[0-9]+" qt_major "${rviz_QT_VERSION}")
find_package(Qt${qt_major} REQUIRED COMPONENTS Widgets)

add_library(${PROJECT_NAME}_rviz_logic STATIC
  src/ros/rviz/feature_mesh.cpp
  src/ros/rviz/knobs.cpp
  src/ros/rviz/map_history.cpp
  src/ros/rviz/map_mesh.cpp
  src/ros/rviz/object_mesh.cpp
  src/ros/rviz/polygon_mesh.cpp
  src/ros/rviz/stage_board.cpp)
situation_awareness_target(${PROJECT_NAME}_rviz_logic)
target_link_libraries(${PROJECT_NAME}_rviz_logic PUBLIC ${PROJECT_NAME}_ros)
target_precompile_headers(${PROJECT_NAME}_rviz_logic REUSE_FROM ${PROJECT_NAME}_ros)

add_library(${PROJECT_NAME}_rviz
  src/ros/rviz/knob_form.cpp
  src/ros/rviz/map_scene.cpp
  src/ros/rviz/semantic_map_display.cpp
  src/ros/rviz/service_caller.cpp
  src/ros/rviz/status_panel.cpp)
situation_awareness_target(${PROJECT_NAME}_rviz)
set_target_properties(${PROJECT_NAME}_rviz PROPERTIES AUTOMOC ON)
target_compile_definitions(${PROJECT_NAME}_rviz PRIVATE QT_NO_KEYWORDS)  # Boost has signals of its own
target_include_directories(${PROJECT_NAME}_rviz SYSTEM PRIVATE ${rviz_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_rviz PRIVATE ${PROJECT_NAME}_rviz_logic Qt${qt_major}::Widgets ${rviz_LIBRARIES})

install(TARGETS ${PROJECT_NAME}_rviz LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(FILES rviz_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
