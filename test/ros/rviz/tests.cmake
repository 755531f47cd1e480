# Tests of what rviz loads: its logic, and the plugins themselves without a screen.
foreach(name knobs map_history map_mesh object_mesh polygon_mesh stage_board)
  situation_awareness_ros_gtest(ros_rviz_tests rviz/${name}_test ${PROJECT_NAME}_rviz_logic)
endforeach()

# rostest finds a program where rosrun does; these are not installed.
find_package(Qt${qt_major} REQUIRED COMPONENTS Test Widgets)
foreach(name display panel panel_live)
  add_executable(rviz_${name}_test rviz/${name}_test.cpp)
  situation_awareness_target(rviz_${name}_test)
  target_compile_options(rviz_${name}_test PRIVATE ${test_options})  # Qt wants -fPIC: no precompiled headers of others
  target_compile_definitions(rviz_${name}_test PRIVATE QT_NO_KEYWORDS)
  target_include_directories(rviz_${name}_test SYSTEM PRIVATE ${rviz_INCLUDE_DIRS})
  target_link_libraries(rviz_${name}_test PRIVATE ${PROJECT_NAME}_ros Qt${qt_major}::Test Qt${qt_major}::Widgets
    ${rviz_LIBRARIES} GTest::gtest)
  set_target_properties(rviz_${name}_test PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${situation_awareness_node_dir})
  add_dependencies(rviz_${name}_test ${PROJECT_NAME}_rviz)  # loaded by its name, as rviz does
  situation_awareness_ros_test(rviz/${name}_test xvfb-run -a -s "-screen 0 1280x800x24 +extension GLX +render -noreset"
    rostest ${CMAKE_CURRENT_SOURCE_DIR}/rviz/${name}.test)
  set_tests_properties(ros/rviz/${name}_test PROPERTIES RESOURCE_LOCK display)  # xvfb-run takes a free number, not safely
endforeach()
