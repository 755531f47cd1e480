// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifndef Q_MOC_RUN
#include <functional>
#include <string>
#include <vector>

#include <QLabel>
#include <QScrollArea>

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include "service_caller.hpp"
#include "situation_awareness/ros/rviz/knobs.hpp"
#endif

class QFormLayout;

namespace situation_awareness {

/// The live parameters of one nodelet, as described by its dynamic_reconfigure server. Disabled while the server is not
/// available; the node handle's callbacks run in the GUI's thread.
class KnobForm : public QScrollArea {
  Q_OBJECT

 public:
  /// `server` is the server's namespace: "mapping/live".
  KnobForm(const std::string& server, ServiceCaller& caller, QWidget* parent);

  void connect_to(const ros::NodeHandle& node);

  /// Check whether the server is available.
  void refresh();

 Q_SIGNALS:
  void answered(bool good, const QString& text);

 private:
  struct Row {
    Knob knob;
    std::function<void(const KnobValue&)> show;  ///< without a request to the server
  };

  void receive_description(const dynamic_reconfigure::ConfigDescription& msg);
  void receive_values(const dynamic_reconfigure::Config& msg);
  void build();
  std::function<void(const KnobValue&)> add_editor(const Knob& knob);
  void send(const std::string& name, const KnobValue& value);

  std::string server_;
  ServiceCaller& caller_;
  ros::NodeHandle node_;
  ros::Subscriber descriptions_, updates_;
  std::vector<Row> rows_;
  dynamic_reconfigure::Config known_;  ///< the latest values from the server
  QLabel* absent_ = nullptr;
};

}  // namespace situation_awareness
