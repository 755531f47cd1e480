// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include <QAbstractSpinBox>
#include <QApplication>
#include <QFileDialog>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTest>
#include <QTimer>
#include <QTreeWidget>

#include <gtest/gtest.h>
#include <rviz/panel.h>
#include <pluginlib/class_loader.hpp>

namespace situation_awareness {

inline bool until(const std::function<bool()>& condition, int timeout_ms = 10'000) {
  for (int waited_ms = 0; waited_ms < timeout_ms && !condition(); waited_ms += 20) QTest::qWait(20);
  return condition();
}

/// Enters a number as a user does.
inline void type(QAbstractSpinBox* box, const char* text) {
  box->selectAll();
  QTest::keyClicks(box, text);
  QTest::keyClick(box, Qt::Key_Return);
}

/// The panel as rviz loads it.
class PanelTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { loader_ = new pluginlib::ClassLoader<rviz::Panel>("rviz", "rviz::Panel"); }
  static void TearDownTestSuite() { delete loader_; }

  void SetUp() override {
    panel_.reset(loader_->createUnmanagedInstance("situation_awareness/Status"));
    panel_->initialize(nullptr);
    panel_->resize(360, 700);
    panel_->show();
  }

  template <class Widget>
  Widget& part(const char* name) const {
    auto* widget = panel_->findChild<Widget*>(name);
    if (widget == nullptr) throw std::runtime_error(std::string(name) + " is not on the panel");
    return *widget;
  }

  std::string cell(int stage, int column) const {
    return part<QTreeWidget>("stages").topLevelItem(stage)->text(column).toStdString();
  }
  std::string answer() const { return part<QLabel>("answer").text().toStdString(); }
  void click(const char* button) const { QTest::mouseClick(&part<QPushButton>(button), Qt::LeftButton); }

  /// Clicks a button that opens a file dialog, and chooses `file` in it.
  void choose(const char* button, const QString& file) const {
    QTimer::singleShot(500, [file] {
      auto* dialog = qobject_cast<QFileDialog*>(QApplication::activeModalWidget());
      ASSERT_NE(dialog, nullptr);
      dialog->findChild<QLineEdit*>("fileNameEdit")->setText(file);
      QMetaObject::invokeMethod(dialog, "accept");
    });
    click(button);
  }

  static inline pluginlib::ClassLoader<rviz::Panel>* loader_ = nullptr;
  std::unique_ptr<rviz::Panel> panel_;
};

}  // namespace situation_awareness
