# The ROS boundary: a library of conversions, the nodelets, the nodes and the offline tool, and their installation.
add_library(${PROJECT_NAME}_ros
  src/ros/convert/cloud.cpp
  src/ros/convert/detections.cpp
  src/ros/convert/grid.cpp
  src/ros/convert/hit_labels.cpp
  src/ros/convert/images.cpp
  src/ros/convert/labels.cpp
  src/ros/convert/map.cpp
  src/ros/convert/mission.cpp
  src/ros/convert/motion_sensors.cpp
  src/ros/convert/navigation_sensors.cpp
  src/ros/convert/objects.cpp
  src/ros/convert/odometry.cpp
  src/ros/convert/poses.cpp
  src/ros/convert/safety.cpp
  src/ros/convert/scan.cpp
  src/ros/convert/scouting.cpp
  src/ros/convert/segments.cpp
  src/ros/gps_ins_input.cpp
  src/ros/gps_ins_report.cpp
  src/ros/inertial_input.cpp
  src/ros/inertial_navigation.cpp
  src/ros/map_output.cpp
  src/ros/mission_memory.cpp
  src/ros/map_subscriber.cpp
  src/ros/markers/grid_markers.cpp
  src/ros/markers/map_markers.cpp
  src/ros/markers/object_markers.cpp
  src/ros/markers/object_shapes.cpp
  src/ros/markers/polygon_markers.cpp
  src/ros/markers/reflector_markers.cpp
  src/ros/markers/safety_markers.cpp
  src/ros/markers/scout_markers.cpp
  src/ros/markers/shown_markers.cpp
  src/ros/markers/splinegon_markers.cpp
  src/ros/markers/truth_markers.cpp
  src/ros/master_watch.cpp
  src/ros/nis_report.cpp
  src/ros/odometry_covariances.cpp
  src/ros/pose_covariance_input.cpp
  src/ros/pose_offset_report.cpp
  src/ros/object_report.cpp
  src/ros/odometry_input.cpp
  src/ros/pace.cpp
  src/ros/params/circumnavigate_nodelet_params.cpp
  src/ros/params/gps_ins_nodelet_params.cpp
  src/ros/params/live_params.cpp
  src/ros/params/grid_nodelet_params.cpp
  src/ros/params/image_labelling_nodelet_params.cpp
  src/ros/params/localization_nodelet_params.cpp
  src/ros/params/map_nodelet_params.cpp
  src/ros/params/nodelet_params.cpp
  src/ros/params/object_nodelet_params.cpp
  src/ros/params/package.cpp
  src/ros/params/param_reader.cpp
  src/ros/params/path_nodelet_params.cpp
  src/ros/params/scout_nodelet_params.cpp
  src/ros/params/shared_file.cpp
  src/ros/receipt.cpp
  src/ros/reflector_report.cpp
  src/ros/scan_check.cpp
  src/ros/scans_on_base.cpp
  src/ros/semantic_map_input.cpp
  src/ros/services.cpp
  src/ros/simulation.cpp
  src/ros/stage_context.cpp
  src/ros/stage_diagnostics.cpp
  src/ros/transform_age.cpp
  src/ros/transform_queue.cpp
  src/ros/convert/camera.cpp
  src/ros/convert/compressed_image.cpp)
situation_awareness_target(${PROJECT_NAME}_ros)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PUBLIC ${catkin_INCLUDE_DIRS} ${roslib_INCLUDE_DIRS}
  ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_INCLUDE_DESTINATION})
# Clouds. pcl_conversions is a header; its catkin package would link some 40 libraries of VTK and OpenNI for it.
find_package(PCL REQUIRED COMPONENTS common)
find_path(PCL_CONVERSIONS_INCLUDE_DIR pcl_conversions/pcl_conversions.h REQUIRED)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PRIVATE ${PCL_INCLUDE_DIRS} ${PCL_CONVERSIONS_INCLUDE_DIR})
# The file, not the target: that has definitions for Boost, with which no other library can use the precompiled headers.
target_link_libraries(${PROJECT_NAME}_ros PRIVATE $<TARGET_LINKER_FILE:pcl_common>)
target_link_libraries(${PROJECT_NAME}_ros PUBLIC ${PROJECT_NAME}_core ${catkin_LIBRARIES} ${roslib_LIBRARIES}
  PRIVATE ${GeographicLib_LIBRARIES})
add_dependencies(${PROJECT_NAME}_ros ${PROJECT_NAME}_generate_messages_cpp ${catkin_EXPORTED_TARGETS})
set(situation_awareness_ros_headers ${situation_awareness_headers} <ros/ros.h> <sensor_msgs/PointCloud2.h>
  <tf2_ros/buffer.h> <visualization_msgs/MarkerArray.h>)
# Precompiled once, in 15 s, for all that has the same options and definitions: libraries and programs.
target_precompile_headers(${PROJECT_NAME}_ros PRIVATE ${situation_awareness_ros_headers})

add_library(${PROJECT_NAME}_nodelets
  src/ros/nodelets/circumnavigate_nodelet.cpp
  src/ros/nodelets/detection_nodelet.cpp
  src/ros/nodelets/grid_mapping_nodelet.cpp
  src/ros/nodelets/gps_ins_nodelet.cpp
  src/ros/nodelets/image_labelling_nodelet.cpp
  src/ros/nodelets/inertial_semantic_map_nodelet.cpp
  src/ros/nodelets/mapping_nodelet.cpp
  src/ros/nodelets/path_following_nodelet.cpp
  src/ros/nodelets/reflector_localization_nodelet.cpp
  src/ros/nodelets/safety_areas_nodelet.cpp
  src/ros/nodelets/scout_nodelet.cpp
  src/ros/nodelets/segmentation_nodelet.cpp
  src/ros/nodelets/semantic_map_nodelet.cpp
  src/ros/nodelets/slicing_nodelet.cpp)
situation_awareness_target(${PROJECT_NAME}_nodelets)
target_link_libraries(${PROJECT_NAME}_nodelets PRIVATE ${PROJECT_NAME}_ros)
target_precompile_headers(${PROJECT_NAME}_nodelets REUSE_FROM ${PROJECT_NAME}_ros)
set_target_properties(${PROJECT_NAME}_nodelets PROPERTIES UNITY_BUILD_BATCH_SIZE 4)  # eight take 1.5 GB of memory

# situation_awareness_node(NAME SOURCE LIBRARY...): a program for rosrun.
function(situation_awareness_node name source)
  add_executable(${name} ${source})
  situation_awareness_target(${name})
  target_compile_options(${name} PRIVATE -fPIC)  # as the library whose precompiled headers it uses
  target_precompile_headers(${name} REUSE_FROM ${PROJECT_NAME}_ros)
  target_link_libraries(${name} PRIVATE ${PROJECT_NAME}_ros ${ARGN})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${situation_awareness_node_dir})
  install(TARGETS ${name} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

# Common code of the programs that read a bag; not installed.
add_library(${PROJECT_NAME}_bag STATIC
  src/ros/bag/line_file.cpp
  src/ros/bag/localization.cpp
  src/ros/bag/navigation.cpp
  src/ros/bag/bag_options.cpp
  src/ros/bag/bag_player.cpp
  src/ros/bag/images.cpp
  src/ros/bag/json_line.cpp
  src/ros/bag/odometry.cpp
  src/ros/bag/progress.cpp
  src/ros/bag/recording.cpp
  src/ros/bag/scans.cpp)
situation_awareness_target(${PROJECT_NAME}_bag)
target_link_libraries(${PROJECT_NAME}_bag PUBLIC
  ${PROJECT_NAME}_ros ${PROJECT_NAME}_command_line nlohmann_json::nlohmann_json)
target_precompile_headers(${PROJECT_NAME}_bag REUSE_FROM ${PROJECT_NAME}_ros)

situation_awareness_node(ground_map src/ros/nodes/ground_map.cpp)
# What check_bag finds out about a recording; not installed.
add_library(${PROJECT_NAME}_check STATIC
  src/ros/check/camera.cpp
  src/ros/check/motion.cpp
  src/ros/check/recording_check.cpp
  src/ros/check/report.cpp
  src/ros/check/scanner_motion.cpp
  src/ros/check/scans.cpp
  src/ros/check/stamp_statistics.cpp
  src/ros/check/topic_check.cpp
  src/ros/check/transform_tree.cpp)
situation_awareness_target(${PROJECT_NAME}_check)
target_link_libraries(${PROJECT_NAME}_check PUBLIC ${PROJECT_NAME}_bag)
target_precompile_headers(${PROJECT_NAME}_check REUSE_FROM ${PROJECT_NAME}_ros)

situation_awareness_node(check_bag src/ros/tools/check_bag.cpp ${PROJECT_NAME}_check)
situation_awareness_node(grid_bag src/ros/tools/grid_bag.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(map_bag src/ros/tools/map_bag.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(objects_bag src/ros/tools/objects_bag.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(polygons_bag src/ros/tools/polygons_bag.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(record_reflectors src/ros/tools/record_reflectors.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(splinegons_bag src/ros/tools/splinegons_bag.cpp ${PROJECT_NAME}_bag)
situation_awareness_node(stage_manager src/ros/nodes/stage_manager.cpp)
if(SITUATION_AWARENESS_SIM)
  set(situation_awareness_sensors ${PROJECT_NAME}_sim $<TARGET_NAME_IF_EXISTS:${PROJECT_NAME}_camera>)
  situation_awareness_node(simulator src/ros/nodes/simulator/simulator.cpp ${situation_awareness_sensors})
  target_sources(simulator PRIVATE src/ros/nodes/simulator/sensors.cpp src/ros/nodes/simulator/vehicles.cpp)
  situation_awareness_node(evaluator src/ros/nodes/evaluator/evaluator.cpp ${PROJECT_NAME}_metrics ${PROJECT_NAME}_sim)
  target_sources(evaluator PRIVATE src/ros/nodes/evaluator/boundaries.cpp src/ros/nodes/evaluator/features.cpp
    src/ros/nodes/evaluator/targets.cpp src/ros/nodes/evaluator/transits.cpp)
  situation_awareness_node(simulate_bag src/ros/tools/simulate_bag.cpp ${PROJECT_NAME}_bag
    ${situation_awareness_sensors})
  install(TARGETS ${PROJECT_NAME}_sim LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
    ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
  if(TARGET ${PROJECT_NAME}_camera)
    situation_awareness_node(camera src/ros/nodes/camera.cpp ${PROJECT_NAME}_camera)
    install(TARGETS ${PROJECT_NAME}_camera LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
      ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
  endif()
endif()
# A tool of the core: rosrun finds it here.
set_target_properties(dubins_path PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${situation_awareness_node_dir})
install(TARGETS dubins_path RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
include(cmake/ros_bridges.cmake)

# What docs/parameters.md is made by.
add_executable(parameter_reference tools/parameter_reference.cpp)
situation_awareness_target(parameter_reference)
target_link_libraries(parameter_reference PRIVATE ${PROJECT_NAME}_ros)

install(TARGETS ${PROJECT_NAME}_core ${PROJECT_NAME}_ros ${PROJECT_NAME}_nodelets
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION}
  FILES_MATCHING PATTERN *.hpp
  PATTERN bridges EXCLUDE  # those need messages of other packages
  PATTERN bag EXCLUDE PATTERN check EXCLUDE PATTERN evaluation EXCLUDE)  # of libraries that are not installed
install(FILES nodelets.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY cfg launch models DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
# Of the scripts only those for users: the others build and test a source tree.
install(PROGRAMS examples/plot_objects_bag.py scripts/check_live scripts/fleet_rviz scripts/ros2_to_ros1
  DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
