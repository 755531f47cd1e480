// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#ifndef Q_MOC_RUN
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <QObject>
#include <QString>
#include <QTimer>

#include <ros/node_handle.h>
#include <ros/service.h>
#endif

namespace situation_awareness {

/// Calls services one after the other in a separate thread. A call times out after kTimeout_ms, and calls waiting
/// behind it are then dropped. Its methods and the responses are in the GUI's thread.
class ServiceCaller : public QObject {
  Q_OBJECT

 public:
  static constexpr int kTimeout_ms = 10'000;

  explicit ServiceCaller(QObject* parent);
  ~ServiceCaller() override;

  /// `done` gets the response, or none and the reason.
  template <class Service>
  void call(const ros::NodeHandle& node, const std::string& name, const typename Service::Request& request,
            std::function<void(const typename Service::Response*, const QString&)> done) {
    auto service = std::make_shared<Service>();
    service->request = request;
    add({[node, name, service](Link& link) { return ask(node, name, *service, link); },
         [service, done](const QString& error) { done(error.isEmpty() ? &service->response : nullptr, error); }});
  }

  bool busy() const { return thread_.joinable(); }

 Q_SIGNALS:
  void busy_changed(bool busy);

 private:
  /// The connection of the current call, which another thread may close.
  struct Link {
    std::mutex mutex;
    bool cut = false;
    ros::ServiceClient client;
  };

  struct Call {
    std::function<QString(Link&)> ask;  ///< returns the reason for a missing response, or nothing
    std::function<void(const QString&)> done;
  };

  template <class Service>
  static QString ask(ros::NodeHandle node, const std::string& name, Service& service, Link& link) {
    const QString shown = QString::fromStdString(name);
    if (!ros::service::exists(node.resolveName(name), false)) return shown + " is not available";
    // Only a persistent connection can be closed while waiting for the response.
    ros::ServiceClient client = node.serviceClient<Service>(name, true);
    {
      const std::lock_guard lock(link.mutex);
      if (link.cut) return shown + ": timeout";
      link.client = client;
    }
    if (client.call(service)) return {};
    const std::lock_guard lock(link.mutex);
    return shown + (link.cut ? ": no answer, timeout" : ": the call failed");
  }

  void add(Call call);
  void start_next();
  void finish(const QString& error);
  void cut();

  std::deque<Call> calls_;  ///< the first is the current one
  std::shared_ptr<Link> link_;
  std::thread thread_;
  QTimer timeout_;
};

}  // namespace situation_awareness
