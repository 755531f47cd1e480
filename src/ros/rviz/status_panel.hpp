// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifndef Q_MOC_RUN
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <QTimer>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <rviz/panel.h>

#include "knob_form.hpp"
#include "service_caller.hpp"
#include "situation_awareness/ros/rviz/stage_board.hpp"
#endif

class QLabel;
class QLineEdit;
class QPushButton;
class QTreeWidget;

namespace situation_awareness {

/// What the stages say of themselves, buttons for the services of the map, and the live parameters. Waits for nothing:
/// callbacks of ROS run from a timer in the GUI's thread, services in another thread.
class StatusPanel : public rviz::Panel {
  Q_OBJECT

 public:
  explicit StatusPanel(QWidget* parent = nullptr);
  ~StatusPanel() override;

  void onInitialize() override;
  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 private:
  QWidget* make_stages();
  QWidget* make_buttons();
  QWidget* make_knobs();

  /// Everything is looked for in the namespace of the field from now on.
  void connect_to_namespace();
  double now_s() const;
  void spin();
  void show_stages();
  void show_values(const StageStatus& stage);
  void show_pause(const StageStatus& mapping);
  void show_answer(bool good, const QString& text);

  void reset_map();
  void toggle_pause();
  void save_map();
  void load_map();

  template <class Service>
  void call(const std::string& name, const typename Service::Request& request, std::function<void()> succeeded = {});

  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::unique_ptr<ros::CallbackQueue> queue_ = std::make_unique<ros::CallbackQueue>();
  ros::NodeHandle node_;
  ros::Subscriber diagnostics_;
  std::unique_ptr<StageBoard> board_;
  ServiceCaller caller_{this};
  bool paused_ = false;
  double paused_at_s_ = 0.0;  ///< since when paused_ is known from an answer
  QTimer spin_timer_, show_timer_;

  QLineEdit* namespace_;
  QTreeWidget* stages_;
  QTreeWidget* values_;
  QPushButton* pause_;
  QLabel* answer_;
  std::vector<KnobForm*> forms_;
};

}  // namespace situation_awareness
