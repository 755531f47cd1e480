// SPDX-License-Identifier: BSD-3-Clause
// A day of simulated scans for the running nodelets, with random faults: the raw data of scripts/evaluate reliability.
// test/ros/fault_day.launch starts it.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "faults.hpp"
#include "feed.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kScansPerHour = 3600.0 / kScanPeriod_s;
constexpr double kMostUntilBack_s = 2.0;
constexpr double kLeastGap_s = 4.0;       ///< from fault to fault: twice the time that the map has
constexpr double kBlock_s = 600.0;        ///< from settling of accounts to settling of accounts
constexpr double kFirstDeathPart = 0.75;  ///< before, one process lives: its memory is watched
constexpr std::size_t kMostSentences = 100;

constexpr const char* kDescription =
    R"(Sends simulated scans to the nodelets, with faults at random, and writes what became of them: a line of JSON per
block of 600 s, and at last one for all faults. The exit code is 1 if something did not happen as it must.
)";

struct Options {
  std::string out;
  double hours = 12.0;
  double fault_every_s = 15.0;
  std::uint64_t seed = 1;
  int under_way = 3;
  int rounds = 0;
  std::string only;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("--out", options.out, "where the lines go").required().type_name("FILE");
  app.add_option("--hours", options.hours, "of scans").type_name("H").check(from_to(0.0, 10000.0));
  app.add_option("--fault-every-s", options.fault_every_s, "from fault to fault, on average")
      .type_name("S")
      .check(from_to(kLeastGap_s, 3600.0));
  app.add_option("--seed", options.seed, "of scene and faults").type_name("N").check(from_to(0.0, 1e9));
  app.add_option("--under-way", options.under_way, "scans that may be sent before the map of the first is back")
      .type_name("N")
      .check(from_to(1.0, 1000.0));
  app.add_option("--rounds", options.rounds,
                 "of all faults, ends of processes in the first alone;\n0: as many as there is time for")
      .type_name("N")
      .check(from_to(0.0, 1e6));
  app.add_option("--only", options.only, "the fault of that name alone")
      .type_name("NAME")
      .check(Check([](const std::string& name) {
        const std::vector<Fault> faults = all_faults();
        const bool known = std::any_of(faults.begin(), faults.end(), [&](const Fault& f) { return f.name == name; });
        return known ? "" : "no fault is called " + name;
      }));
}

std::int64_t resident_bytes() {
  std::ifstream file("/proc/" + std::to_string(manager_pid()) + "/statm");
  std::int64_t pages = 0;
  file >> pages >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

std::string changes(const std::vector<std::uint64_t>& before, const std::vector<std::uint64_t>& after) {
  std::string text;
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    if (before[i] == after[i]) continue;
    text +=
        " object " + std::to_string(i + 1) + " from " + std::to_string(before[i]) + " to " + std::to_string(after[i]);
  }
  return text;
}

struct Tally {
  int count = 0;
  std::int64_t sent = 0, mapped = 0;
  int other_ids = 0;  ///< faults after which an object had another id than before
  std::vector<double> back_s, down_s;
  std::vector<std::string> failures;
};

class Day {
 public:
  Day(ros::NodeHandle& node, const Options& options)
      : options_(options),
        feed_(node, options.seed, options.under_way),
        faults_(all_faults()),
        tallies_(faults_.size()),
        out_(options.out) {
    if (!out_) throw std::runtime_error(options.out + ": cannot be written");
  }

  /// Whether all expected outcomes occurred.
  bool run() {
    if (!feed_.wait_for_stages()) throw std::runtime_error("the stages did not come within 60 s");
    feed_.forget_accounts();
    feed_.step(100);
    while (ros::ok() && !over()) {
      const std::size_t fault = next();
      inject(faults_[fault], tallies_[fault]);
      if (feed_.sent() >= block_end_ || over()) settle();
    }
    return report();
  }

 private:
  std::int64_t of() const { return std::llround(options_.hours * kScansPerHour); }
  bool over() const { return options_.rounds > 0 ? round_ > options_.rounds : feed_.sent() >= of(); }

  /// Each fault once in a round, in a new random order.
  std::size_t next() {
    if (order_.empty()) {
      ++round_;
      const bool late = static_cast<double>(feed_.sent()) >= kFirstDeathPart * static_cast<double>(of());
      const bool deaths = options_.rounds > 0 ? round_ == 1 : late;
      for (std::size_t i = 0; i < faults_.size(); ++i) {
        const bool wanted = options_.only.empty() ? faults_[i].in_day && (deaths || !faults_[i].death)
                                                  : faults_[i].name == options_.only;
        if (wanted) order_.push_back(i);
      }
      for (std::size_t i = order_.size(); i > 1; --i) {
        std::swap(order_[i - 1], order_[static_cast<std::size_t>(feed_.random().uniform() * static_cast<double>(i))]);
      }
    }
    const std::size_t fault = order_.back();
    order_.pop_back();
    if (order_.empty() && options_.rounds > 0 && round_ == options_.rounds) ++round_;
    return fault;
  }

  void inject(const Fault& fault, Tally& tally) {
    const std::vector<std::uint64_t> ids = feed_.latest_good().ids;
    const std::uint64_t highest_id = feed_.highest_id();
    const std::int64_t sent = feed_.sent(), maps = feed_.maps();
    std::string wrong = feed_.good_since_ns() ? "" : "before it: " + feed_.latest().defect;

    const Injected injected = fault.inject(feed_);
    feed_.drain();
    const std::int64_t end_ns = feed_.stamp_ns() - SyntheticScene::kStep_ns;
    const std::int64_t from_ns = injected.from_ns.value_or(end_ns);
    ++tally.count;
    tally.sent += feed_.sent() - sent;
    tally.mapped += feed_.maps() - maps;
    wrong += injected.wrong;
    if (injected.down_s) tally.down_s.push_back(*injected.down_s);

    const double gap_s = feed_.random().uniform(kLeastGap_s, 2.0 * options_.fault_every_s - kLeastGap_s);
    constexpr int kStepped = 10;
    feed_.step(kStepped);
    feed_.stream(static_cast<int>(gap_s / kScanPeriod_s) - kStepped);
    if (const auto good_since_ns = feed_.good_since_ns()) {
      const double back_s = std::max(0.0, seconds_between(from_ns, *good_since_ns));
      tally.back_s.push_back(back_s);
      if (back_s > kMostUntilBack_s) wrong += "the map was back after " + std::to_string(back_s) + " s; ";
      const std::vector<std::uint64_t>& now = feed_.latest_good().ids;
      if (now != ids) ++tally.other_ids;
      if (fault.ids == Ids::kKept && now != ids) wrong += "ids changed:" + changes(ids, now) + "; ";
      const bool all_new = std::all_of(now.begin(), now.end(), [&](std::uint64_t id) { return id > highest_id; });
      if (fault.ids == Ids::kNew && !all_new) wrong += "ids were used again; ";
    } else {
      wrong += "the map was not back: " + feed_.latest().defect;
    }
    for (const std::string& failure : feed_.take_failures()) wrong += failure + "; ";
    if (!wrong.empty()) tally.failures.push_back("at scan " + std::to_string(feed_.sent()) + ": " + wrong);
    if (!wrong.empty()) std::fprintf(stderr, "%s: %s\n", fault.name.c_str(), wrong.c_str());
  }

  void settle() {
    const std::string wrong = feed_.settle();
    if (!wrong.empty()) {
      accounts_.push_back("at scan " + std::to_string(feed_.sent()) + ": " + wrong);
      std::fprintf(stderr, "accounts: %s\n", wrong.c_str());
    }
    ++settled_;
    block_end_ = feed_.sent() + std::llround(kBlock_s / kScanPeriod_s);
    int faults = 0;
    std::size_t failures = accounts_.size();
    for (const Tally& tally : tallies_) {
      faults += tally.count;
      failures += tally.failures.size();
    }
    const double part = options_.rounds > 0 ? static_cast<double>(round_ - 1) / options_.rounds
                                            : static_cast<double>(feed_.sent()) / static_cast<double>(of());
    const Json line = {{"part", std::min(part, 1.0)},
                       {"hours", static_cast<double>(feed_.sent()) / kScansPerHour},
                       {"faults", faults},
                       {"failures", failures},
                       {"pid", manager_pid()},
                       {"resident_bytes", resident_bytes()}};
    out_ << line.dump() << std::endl;
  }

  bool report() {
    bool right = accounts_.empty() && ros::ok();
    Json faults = Json::array();
    for (std::size_t i = 0; i < faults_.size(); ++i) {
      Tally& tally = tallies_[i];
      std::sort(tally.back_s.begin(), tally.back_s.end());
      std::sort(tally.down_s.begin(), tally.down_s.end());
      right = right && tally.failures.empty();
      if (tally.failures.size() > kMostSentences) tally.failures.resize(kMostSentences);
      faults.push_back({{"name", faults_[i].name},
                        {"how", faults_[i].how},
                        {"must", faults_[i].must},
                        {"death", faults_[i].death},
                        {"in_day", faults_[i].in_day},
                        {"count", tally.count},
                        {"sent", tally.sent},
                        {"mapped", tally.mapped},
                        {"other_ids", tally.other_ids},
                        {"back_s", tally.back_s},
                        {"down_s", tally.down_s},
                        {"failures", tally.failures}});
    }
    const Json line = {{"faults", faults},    {"sent", feed_.sent()},  {"mapped", feed_.maps()},
                       {"settled", settled_}, {"accounts", accounts_}, {"right", right}};
    out_ << line.dump() << std::endl;
    return right;
  }

  Options options_;
  Feed feed_;
  std::vector<Fault> faults_;
  std::vector<Tally> tallies_;
  std::ofstream out_;
  std::vector<std::size_t> order_;  ///< of faults, those still to come in this round, from the back
  int round_ = 0;
  int settled_ = 0;
  std::int64_t block_end_ = std::llround(kBlock_s / kScanPeriod_s);
  std::vector<std::string> accounts_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  ros::init(argc, argv, "fault_day");
  Options options;
  CommandLine app("fault_day", kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] {
    ros::NodeHandle node;
    ros::AsyncSpinner spinner(1);
    spinner.start();
    Day day(node, options);
    const bool right = day.run();
    ros::shutdown();
    return right ? 0 : 1;
  });
}
