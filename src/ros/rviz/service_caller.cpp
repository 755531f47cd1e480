// SPDX-License-Identifier: BSD-3-Clause
#include "service_caller.hpp"

#include <exception>
#include <utility>

namespace situation_awareness {

ServiceCaller::ServiceCaller(QObject* parent) : QObject(parent) {
  timeout_.setSingleShot(true);
  timeout_.setInterval(kTimeout_ms);
  connect(&timeout_, &QTimer::timeout, this, &ServiceCaller::cut);
}

ServiceCaller::~ServiceCaller() {
  if (!busy()) return;
  cut();
  thread_.join();
}

void ServiceCaller::add(Call call) {
  calls_.push_back(std::move(call));
  if (busy()) return;
  start_next();
  Q_EMIT busy_changed(true);
}

void ServiceCaller::start_next() {
  link_ = std::make_shared<Link>();
  timeout_.start();
  thread_ = std::thread([this, link = link_, ask = calls_.front().ask] {
    QString error;
    try {
      error = ask(*link);
    } catch (const std::exception& failure) {
      error = failure.what();
    }
    QMetaObject::invokeMethod(
        this, [this, error] { finish(error); }, Qt::QueuedConnection);
  });
}

void ServiceCaller::finish(const QString& error) {
  thread_.join();
  timeout_.stop();
  const Call ended = std::move(calls_.front());
  calls_.pop_front();
  if (link_->cut) calls_.clear();  // after a timeout no further calls to the server
  ended.done(error);               // may add a call, which waits or starts
  if (busy()) return;
  if (calls_.empty()) {
    Q_EMIT busy_changed(false);
  } else {
    start_next();
  }
}

void ServiceCaller::cut() {
  const std::lock_guard lock(link_->mutex);
  link_->cut = true;
  link_->client.shutdown();
}

}  // namespace situation_awareness
