// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifndef Q_MOC_RUN
#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <QStringList>
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

class QFormLayout;
class QLabel;
class QLineEdit;
class QPushButton;
class QTabWidget;
class QTreeWidget;

namespace situation_awareness {

/// Status of the stages, buttons for the services of the one map, and the live parameters. The stages are given by a
/// field that is saved with rviz's configuration; the last one keeps the map. It does not block: callbacks of ROS run
/// from a timer in the GUI's thread, services in another thread.
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
  QLineEdit* add_field(QFormLayout& form, const char* name, const char* label, const char* text, const char* hint);

  /// The saved fields, by their names in rviz's configuration.
  std::array<std::pair<const char*, QLineEdit*>, 2> fields() const;

  /// Applies the fields.
  void connect_to_stages();

  /// Replaces the rows and tabs by one of each per stage.
  void show_rows_of(const QStringList& stages);
  double now_s() const;
  void spin();
  void show_stages();
  void show_values(const StageStatus& stage);
  void show_pause(const StageStatus& mapping);
  void show_answer(bool good, const QString& text);
  void enable_buttons();

  void reset_map();
  void toggle_pause();
  void save_map();
  void load_map();

  /// A service of the map: its name begins with semantic_map, whichever stage keeps it.
  template <class Service>
  void call_map(const std::string& service, const typename Service::Request& request,
                std::function<void()> succeeded = {});

  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::unique_ptr<ros::CallbackQueue> queue_ = std::make_unique<ros::CallbackQueue>();
  ros::NodeHandle node_;
  ros::Subscriber diagnostics_;
  std::unique_ptr<StageBoard> board_;
  ServiceCaller caller_{this};
  bool paused_ = false;
  double paused_at_s_ = 0.0;  ///< time of the response that set paused_
  QTimer spin_timer_, show_timer_;

  QLineEdit* namespace_field_;
  QLineEdit* stages_field_;
  QTreeWidget* stages_;
  QTreeWidget* values_;
  QPushButton *reset_, *pause_, *save_, *load_;
  QLabel* answer_;
  QTabWidget* tabs_;
  QStringList shown_stages_;
  std::vector<KnobForm*> forms_;
};

}  // namespace situation_awareness
