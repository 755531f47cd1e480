// SPDX-License-Identifier: BSD-3-Clause
#include "status_panel.hpp"

#include <exception>
#include <stdexcept>

#include <QFileDialog>
#include <QFormLayout>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QLineEdit>
#include <QPainter>
#include <QPixmap>
#include <QPushButton>
#include <QSignalBlocker>
#include <QSplitter>
#include <QTabWidget>
#include <QTreeWidget>
#include <QVBoxLayout>

#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/LoadMap.h"
#include "situation_awareness/SaveMap.h"

namespace situation_awareness {
namespace {

constexpr int kSpinPeriod_ms = 50;
constexpr int kShowPeriod_ms = 500;
const char* const kMapFiles = "Maps (*.json);;All files (*)";

enum StageColumn { kStage, kState, kRate, kLatency };

QColor color_of(StageStatus::Level level) {
  switch (level) {
    case StageStatus::Level::kOk:
      return {0x2e, 0x9e, 0x4f};
    case StageStatus::Level::kWarn:
      return {0xe0, 0x8a, 0x00};
    case StageStatus::Level::kError:
      return {0xcc, 0x22, 0x22};
    case StageStatus::Level::kStale:
      break;
  }
  return {0x88, 0x88, 0x88};
}

QIcon dot(const QColor& color) {
  QPixmap pixmap(16, 16);
  pixmap.fill(Qt::transparent);
  QPainter painter(&pixmap);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setPen(Qt::NoPen);
  painter.setBrush(color);
  painter.drawEllipse(2, 2, 12, 12);
  return QIcon(pixmap);
}

QString value_or_dash(const StageStatus& stage, const char* key) {
  const auto value = stage.value(key);
  return value && stage.level != StageStatus::Level::kStale ? QString::fromStdString(*value) : QString("–");
}

QTreeWidget* make_table(const char* name, const QStringList& columns) {
  auto* table = new QTreeWidget;
  table->setObjectName(name);
  table->setHeaderLabels(columns);
  table->setRootIsDecorated(false);
  table->setAlternatingRowColors(true);
  table->setUniformRowHeights(true);
  return table;
}

}  // namespace

StatusPanel::StatusPanel(QWidget* parent) : rviz::Panel(parent) {
  node_.setCallbackQueue(queue_.get());

  auto* header = new QFormLayout;
  namespace_field_ = add_field(*header, "namespace", "Namespace", "", "that of rviz; or /robot1");
  stages_field_ =
      add_field(*header, "stage_names", "Stages", "segmentation detection mapping semantic_map", "along the data path");

  answer_ = new QLabel;
  answer_->setObjectName("answer");
  answer_->setWordWrap(true);
  answer_->setTextInteractionFlags(Qt::TextSelectableByMouse);

  auto* splitter = new QSplitter(Qt::Vertical);
  splitter->addWidget(make_stages());
  splitter->addWidget(make_knobs());
  splitter->setChildrenCollapsible(false);
  splitter->setStretchFactor(0, 1);
  splitter->setSizes({300, 260});

  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(6, 6, 6, 6);
  layout->addLayout(header);
  layout->addWidget(make_buttons());
  layout->addWidget(answer_);
  layout->addWidget(splitter, 1);

  connect(&spin_timer_, &QTimer::timeout, this, &StatusPanel::spin);
  connect(&show_timer_, &QTimer::timeout, this, &StatusPanel::show_stages);
}

StatusPanel::~StatusPanel() {
  qDeleteAll(forms_);  // before the queue that their subscribers use
}

QLineEdit* StatusPanel::add_field(QFormLayout& form, const char* name, const char* label, const char* text,
                                  const char* hint) {
  auto* field = new QLineEdit(text);
  field->setObjectName(name);
  field->setPlaceholderText(hint);
  form.addRow(label, field);
  connect(field, &QLineEdit::editingFinished, this, [this, field] {
    if (!field->isModified()) return;
    field->setModified(false);
    connect_to_stages();
    Q_EMIT configChanged();
  });
  return field;
}

QWidget* StatusPanel::make_stages() {
  stages_ = make_table("stages", {"Stage", "State", "Hz", "Latency ms"});
  stages_->header()->setSectionResizeMode(QHeaderView::ResizeToContents);
  stages_->header()->setSectionResizeMode(kState, QHeaderView::Stretch);
  stages_->header()->setStretchLastSection(false);
  for (int column : {kRate, kLatency}) stages_->headerItem()->setTextAlignment(column, Qt::AlignRight);

  values_ = make_table("values", {"Value", ""});
  values_->header()->setSectionResizeMode(0, QHeaderView::Stretch);
  values_->header()->setSectionResizeMode(1, QHeaderView::ResizeToContents);
  values_->header()->setStretchLastSection(false);
  values_->setSelectionMode(QAbstractItemView::NoSelection);
  connect(stages_, &QTreeWidget::currentItemChanged, this, &StatusPanel::show_stages);

  auto* part = new QWidget;
  auto* layout = new QVBoxLayout(part);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(stages_);
  layout->addWidget(values_, 1);
  return part;
}

QWidget* StatusPanel::make_buttons() {
  auto* part = new QWidget;
  auto* layout = new QHBoxLayout(part);
  layout->setContentsMargins(0, 0, 0, 0);
  const auto add = [this, layout](const char* name, const QString& text, const QString& tip,
                                  void (StatusPanel::*slot)()) {
    auto* button = new QPushButton(text);
    button->setObjectName(name);
    button->setToolTip(tip);
    connect(button, &QPushButton::clicked, this, slot);
    layout->addWidget(button);
    return button;
  };
  reset_ = add("reset", "Reset", "Delete the map and start a new one", &StatusPanel::reset_map);
  pause_ = add("pause", "Pause", "Freeze the map, or continue", &StatusPanel::toggle_pause);
  save_ = add("save", "Save map…", "Write the map to a file on the host of the node", &StatusPanel::save_map);
  load_ = add("load", "Load map…", "Replace the map by one of a file on the host of the node", &StatusPanel::load_map);
  connect(&caller_, &ServiceCaller::busy_changed, this, &StatusPanel::enable_buttons);
  return part;
}

void StatusPanel::enable_buttons() {
  const bool idle = !caller_.busy();
  for (QPushButton* button : {reset_, pause_, save_, load_}) button->setEnabled(idle);
}

QWidget* StatusPanel::make_knobs() {
  tabs_ = new QTabWidget;
  tabs_->setDocumentMode(true);
  return tabs_;
}

void StatusPanel::onInitialize() {
  if (!board_) connect_to_stages();
  spin_timer_.start(kSpinPeriod_ms);
  show_timer_.start(kShowPeriod_ms);
}

void StatusPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  bool changed = false;
  for (const auto& [key, field] : fields()) {
    QString text;
    if (!config.mapGetString(key, &text) || text == field->text()) continue;
    field->setText(text);
    changed = true;
  }
  if (changed) connect_to_stages();
}

void StatusPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  for (const auto& [key, field] : fields()) config.mapSetValue(key, field->text());
}

std::array<std::pair<const char*, QLineEdit*>, 2> StatusPanel::fields() const {
  return {{{"Namespace", namespace_field_}, {"Stages", stages_field_}}};
}

void StatusPanel::connect_to_stages() {
  try {
    ros::NodeHandle node(namespace_field_->text().trimmed().toStdString());
    node.setCallbackQueue(queue_.get());
    const QStringList stages = stages_field_->text().simplified().split(' ', Qt::SkipEmptyParts);
    if (stages.empty()) throw std::invalid_argument("no stages: at least the one that keeps the map is needed");
    std::vector<std::string> names;
    for (const QString& stage : stages) names.push_back(node.resolveName(stage.toStdString()).substr(1));
    board_ = std::make_unique<StageBoard>(names);
    node_ = node;
    diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100,
        [this](const diagnostic_msgs::DiagnosticArrayConstPtr& msg) { board_->receive(*msg, now_s()); });
    show_rows_of(stages);
    for (KnobForm* form : forms_) form->connect_to(node_);
    paused_ = false;
    enable_buttons();
    show_answer(true, "");
  } catch (const std::exception& error) {
    show_answer(false, error.what());
  }
  show_stages();
}

void StatusPanel::show_rows_of(const QStringList& stages) {
  if (stages == shown_stages_) return;
  shown_stages_ = stages;
  const QSignalBlocker blocker(stages_);
  stages_->clear();
  qDeleteAll(forms_);
  forms_.clear();
  for (const QString& stage : stages) {
    new QTreeWidgetItem(stages_, {stage, "", "", ""});
    forms_.push_back(new KnobForm(stage.toStdString() + "/live", caller_, nullptr));
    forms_.back()->setObjectName(stage);
    connect(forms_.back(), &KnobForm::answered, this, &StatusPanel::show_answer);
    tabs_->addTab(forms_.back(), stage);
  }
  const int rows = stages_->topLevelItemCount();
  stages_->setFixedHeight(stages_->header()->sizeHint().height() + rows * (stages_->fontMetrics().height() + 4) + 2);
  stages_->setCurrentItem(stages_->topLevelItem(rows - 1));
}

double StatusPanel::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void StatusPanel::spin() {
  try {
    queue_->callAvailable(ros::WallDuration(0));
  } catch (const std::exception& error) {
    show_answer(false, error.what());
  }
}

void StatusPanel::show_stages() {
  for (KnobForm* form : forms_) form->refresh();
  if (!board_) return;
  const std::vector<StageStatus> stages = board_->stages(now_s());
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const StageStatus& stage = stages[i];
    QTreeWidgetItem& row = *stages_->topLevelItem(static_cast<int>(i));
    row.setIcon(kStage, dot(color_of(stage.level)));
    row.setText(kState, QString::fromStdString(stage.summary));
    row.setToolTip(kState, row.text(kState));
    row.setForeground(kState, color_of(stage.level));
    row.setText(kRate, value_or_dash(stage, "rate [Hz]"));
    row.setText(kLatency, value_or_dash(stage, "latency p50 [ms]"));
    for (int column : {kRate, kLatency}) row.setTextAlignment(column, Qt::AlignRight);
  }
  show_values(stages[static_cast<std::size_t>(stages_->currentIndex().row())]);
  show_pause(stages.back());
}

void StatusPanel::show_values(const StageStatus& stage) {
  values_->setHeaderLabels({QString::fromStdString(stage.name), ""});
  values_->setEnabled(stage.level != StageStatus::Level::kStale);
  const int count = static_cast<int>(stage.values.size());
  while (values_->topLevelItemCount() > count) delete values_->takeTopLevelItem(count);
  while (values_->topLevelItemCount() < count) new QTreeWidgetItem(values_);
  for (int i = 0; i < count; ++i) {
    const StageValue& value = stage.values[static_cast<std::size_t>(i)];
    QTreeWidgetItem& row = *values_->topLevelItem(i);
    row.setText(0, QString::fromStdString(value.key));
    row.setText(1, QString::fromStdString(value.value));
    row.setTextAlignment(1, Qt::AlignRight);
    row.setToolTip(1, row.text(1));
    const QBrush ink = value.grows_badly ? QBrush(color_of(StageStatus::Level::kWarn)) : QBrush();
    for (int column : {0, 1}) row.setForeground(column, ink);
  }
}

void StatusPanel::show_pause(const StageStatus& mapping) {
  // The response to the button is newer than earlier status messages.
  if (mapping.heard_s.value_or(0.0) > paused_at_s_) paused_ = mapping.paused;
  pause_->setText(paused_ ? "Go on" : "Pause");
}

void StatusPanel::show_answer(bool good, const QString& text) {
  QPalette palette = answer_->palette();
  palette.setColor(QPalette::WindowText, color_of(good ? StageStatus::Level::kOk : StageStatus::Level::kError));
  answer_->setPalette(palette);
  answer_->setText(text);
}

template <class Service>
void StatusPanel::call_map(const std::string& service, const typename Service::Request& request,
                           std::function<void()> succeeded) {
  if (shown_stages_.empty()) return;  // the error in the fields is shown
  const std::string name = "semantic_map/" + service;
  show_answer(true, QString::fromStdString(name) + " …");
  caller_.call<Service>(node_, name, request,
                        [this, name, succeeded](const typename Service::Response* response, const QString& error) {
                          if (response == nullptr) return show_answer(false, error);
                          const bool good = response->success != 0;
                          if (good && succeeded) succeeded();
                          show_answer(good, QString::fromStdString(name + ": " + response->message));
                          show_stages();
                        });
}

void StatusPanel::reset_map() { call_map<std_srvs::Trigger>("reset", {}); }

void StatusPanel::toggle_pause() {
  std_srvs::SetBoolRequest request;
  request.data = !paused_;
  call_map<std_srvs::SetBool>("pause", request, [this, pause = !paused_] {
    paused_ = pause;
    paused_at_s_ = now_s();
  });
}

void StatusPanel::save_map() {
  QFileDialog dialog(this, "Save the map on the host of the node", "map.json", kMapFiles);
  dialog.setAcceptMode(QFileDialog::AcceptSave);
  dialog.setDefaultSuffix("json");
  dialog.setOption(QFileDialog::DontUseNativeDialog);
  if (dialog.exec() != QDialog::Accepted) return;
  SaveMap::Request request;
  request.file = dialog.selectedFiles().front().toStdString();
  call_map<SaveMap>("save_map", request);
}

void StatusPanel::load_map() {
  QFileDialog dialog(this, "Load a map from the host of the node", "", kMapFiles);
  dialog.setAcceptMode(QFileDialog::AcceptOpen);
  dialog.setFileMode(QFileDialog::AnyFile);
  dialog.setOption(QFileDialog::DontUseNativeDialog);
  if (dialog.exec() != QDialog::Accepted) return;
  LoadMap::Request request;
  request.file = dialog.selectedFiles().front().toStdString();
  call_map<LoadMap>("load_map", request);
}

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::StatusPanel, rviz::Panel)
