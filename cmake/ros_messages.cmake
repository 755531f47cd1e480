# Messages, and exports for other packages. Before every target: catkin_package sets where they are built.
if(NOT catkin_FOUND)
  message(FATAL_ERROR "SITUATION_AWARENESS_ROS is ON, but catkin and the ROS packages listed above were not found")
endif()
find_package(roslib REQUIRED)

add_message_files(DIRECTORY msg FILES
  DetectionArray.msg
  EllipseDetection.msg
  GoneFeature.msg
  LaserRefusedRun.msg
  LaserSegment.msg
  LaserSmallSegment.msg
  LaserStraightPiece.msg
  LevelFrame.msg
  MapFeature.msg
  MapUpdate.msg
  MappedObject.msg
  MappedObjectArray.msg
  MappedTarget.msg
  MissionStatus.msg
  PathError.msg
  SafetyVerdict.msg
  ScoutStatus.msg
  SegmentArray.msg
  SegmentPoint.msg
  TargetArray.msg
  ThingOutline.msg
  Transit.msg)
add_service_files(DIRECTORY srv FILES
  LoadMap.srv
  PlanDubins.srv
  Relocate.srv
  SaveGrid.srv
  SaveMap.srv)
generate_messages(DEPENDENCIES geometry_msgs std_msgs)

if(SITUATION_AWARENESS_SIM)
  set(situation_awareness_sim_library ${PROJECT_NAME}_sim)
endif()
catkin_package(
  INCLUDE_DIRS include
  LIBRARIES ${PROJECT_NAME}_core ${PROJECT_NAME}_ros ${situation_awareness_sim_library}
  CATKIN_DEPENDS diagnostic_msgs diagnostic_updater dynamic_reconfigure geometry_msgs message_runtime nav_msgs nodelet
    roscpp rosgraph_msgs sensor_msgs std_msgs std_srvs tf2 tf2_msgs visualization_msgs
  DEPENDS EIGEN3)

# Only what rosrun should offer goes where rosrun looks; tests and benchmarks stay in their own build folders.
set(situation_awareness_node_dir ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
unset(CMAKE_RUNTIME_OUTPUT_DIRECTORY)
