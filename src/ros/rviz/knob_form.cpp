// SPDX-License-Identifier: BSD-3-Clause
#include "knob_form.hpp"

#include <algorithm>
#include <exception>
#include <type_traits>

#include <QCheckBox>
#include <QDoubleSpinBox>
#include <QFormLayout>
#include <QLineEdit>
#include <QPointer>
#include <QSignalBlocker>
#include <QSpinBox>

#include <dynamic_reconfigure/Reconfigure.h>

namespace situation_awareness {
namespace {

/// Shows as many digits as the number needs.
class NumberBox : public QDoubleSpinBox {
 public:
  using QDoubleSpinBox::QDoubleSpinBox;

  QString textFromValue(double value) const override { return QString::number(value, 'g', 9); }
};

/// A wheel that scrolls past a box must not change it.
template <class Box>
Box* make_box(const Knob& knob) {
  auto* box = new Box;
  box->setKeyboardTracking(false);
  box->setFocusPolicy(Qt::StrongFocus);
  box->setMinimumWidth(80);
  using Number = decltype(box->value());
  if constexpr (std::is_same_v<Number, double>) box->setDecimals(6);  // rounds values set from here on
  constexpr auto kWidest = Number{1'000'000'000};                     // a knob without bounds has infinite ones
  box->setRange(std::max(std::get<Number>(knob.low), -kWidest), std::min(std::get<Number>(knob.high), kWidest));
  box->setValue(std::get<Number>(knob.value));
  return box;
}

QString tool_tip(const Knob& knob) {
  QString tip = QString::fromStdString(knob.description).toHtmlEscaped();
  if (!std::holds_alternative<std::string>(knob.value) && !std::holds_alternative<bool>(knob.value)) {
    tip += QString("<br>%1 to %2").arg(text_of(knob.low).c_str(), text_of(knob.high).c_str());
  }
  return "<p>" + tip + "</p>";
}

}  // namespace

KnobForm::KnobForm(const std::string& server, ServiceCaller& caller, QWidget* parent)
    : QScrollArea(parent), server_(server), caller_(caller) {
  setWidgetResizable(true);
  setFrameShape(QFrame::NoFrame);
  build();
}

void KnobForm::connect_to(const ros::NodeHandle& node) {
  node_ = node;
  descriptions_ = node_.subscribe(server_ + "/parameter_descriptions", 1, &KnobForm::receive_description, this);
  updates_ = node_.subscribe(server_ + "/parameter_updates", 1, &KnobForm::receive_values, this);
  known_ = {};
  rows_.clear();
  build();
}

void KnobForm::refresh() {
  const bool there = updates_.getNumPublishers() > 0 && !rows_.empty();
  widget()->setEnabled(there);
  absent_->setVisible(!there);
}

void KnobForm::receive_description(const dynamic_reconfigure::ConfigDescription& msg) {
  const std::vector<Knob> knobs = knobs_of(msg);
  const auto same = [](const Row& row, const Knob& knob) { return row.knob == knob; };
  if (std::equal(rows_.begin(), rows_.end(), knobs.begin(), knobs.end(), same)) return;
  rows_.clear();
  for (const Knob& knob : knobs) rows_.push_back({knob, {}});
  build();
}

void KnobForm::receive_values(const dynamic_reconfigure::Config& msg) {
  known_ = msg;
  for (const Row& row : rows_) {
    const auto value = value_in(msg, row.knob.name);
    if (value && value->index() == row.knob.value.index()) row.show(*value);
  }
}

void KnobForm::build() {
  auto* content = new QWidget;
  auto* form = new QFormLayout(content);
  form->setContentsMargins(6, 6, 6, 6);
  form->setVerticalSpacing(3);
  absent_ = new QLabel(QString::fromStdString(server_) + " is not available");
  form->addRow(absent_);
  setWidget(content);  // deletes the one before
  for (Row& row : rows_) row.show = add_editor(row.knob);
  receive_values(known_);
  refresh();
}

std::function<void(const KnobValue&)> KnobForm::add_editor(const Knob& knob) {
  QWidget* editor = nullptr;
  std::function<void(const KnobValue&)> show;
  const std::string name = knob.name;
  if (std::holds_alternative<bool>(knob.value)) {
    auto* box = new QCheckBox;
    connect(box, &QCheckBox::clicked, this, [this, name](bool checked) { send(name, checked); });
    show = [box](const KnobValue& value) { box->setChecked(std::get<bool>(value)); };
    editor = box;
  } else if (std::holds_alternative<int>(knob.value)) {
    auto* box = make_box<QSpinBox>(knob);
    connect(box, QOverload<int>::of(&QSpinBox::valueChanged), this, [this, name](int value) { send(name, value); });
    show = [box](const KnobValue& value) {
      const QSignalBlocker silent(box);
      box->setValue(std::get<int>(value));
    };
    editor = box;
  } else if (std::holds_alternative<double>(knob.value)) {
    auto* box = make_box<NumberBox>(knob);
    box->setStepType(QAbstractSpinBox::AdaptiveDecimalStepType);
    connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this,
            [this, name](double value) { send(name, value); });
    show = [box](const KnobValue& value) {
      const QSignalBlocker silent(box);
      box->setValue(std::get<double>(value));
    };
    editor = box;
  } else {
    auto* line = new QLineEdit;
    connect(line, &QLineEdit::editingFinished, this, [this, name, line] {
      if (!line->isModified()) return;
      line->setModified(false);
      send(name, line->text().toStdString());
    });
    show = [line](const KnobValue& value) {
      const QString text = QString::fromStdString(std::get<std::string>(value));
      if (!line->isModified() && line->text() != text) line->setText(text);
    };
    editor = line;
  }
  editor->setObjectName(QString::fromStdString(name));
  editor->setToolTip(tool_tip(knob));
  show(knob.value);
  static_cast<QFormLayout*>(widget()->layout())->addRow(QString::fromStdString(name), editor);
  return show;
}

void KnobForm::send(const std::string& name, const KnobValue& value) {
  dynamic_reconfigure::ReconfigureRequest request;
  request.config = config_of(name, value);
  caller_.call<dynamic_reconfigure::Reconfigure>(
      node_, server_ + "/set_parameters", request,
      [form = QPointer<KnobForm>(this), this, name, value](const dynamic_reconfigure::ReconfigureResponse* response,
                                                           const QString& error) {
        if (!form) return;                                                // the panel shows other stages now
        receive_values(response == nullptr ? known_ : response->config);  // the server may have kept another
        if (response == nullptr) return answered(false, error);
        const auto effective = value_in(response->config, name);
        const QString now = effective ? QString::fromStdString(text_of(*effective)) : "unknown";
        const QString shown = QString::fromStdString(name) + " = " + now;
        if (effective && text_of(*effective) == text_of(value)) return answered(true, shown);
        answered(false, shown + ", not " + QString::fromStdString(text_of(value)));
      });
}

}  // namespace situation_awareness
