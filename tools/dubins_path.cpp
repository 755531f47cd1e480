// SPDX-License-Identifier: BSD-3-Clause
// The shortest path from pose to pose for a vehicle that turns on circles. Prints one line of JSON, or one for each
// case of a file.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "situation_awareness/geometry/parse_pose2.hpp"
#include "situation_awareness/path/dubins.hpp"

namespace situation_awareness {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kName = "dubins_path";
constexpr const char* kDescription =
    R"(Prints the shortest path of left turns (L), right turns (R) and straights (S) from a pose to another, in m and rad:
  {"word": "LSL", "length": number, "segments": [one per letter, also where its length is zero:
   {"type": "arc", "center": [x, y], "radius": r, "from": polar angle at the centre, "sweep": to the left positive} or
   {"type": "line", "from": [x, y], "to": [x, y]}]}
With equal radii paths of three turns (LRL, RLR) count, too. No path: exit status 2 and one sentence on stderr.
With --batch one line for each line {"from": [x, y, yaw], "to": [x, y, yaw], "radius_from": r, "radius_to": r,
"max_curvature": K, which may be left out} of the file, {"error": sentence} where there is no path.
)";

/// A case has no path.
struct NoPath : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::string text_of(double number) { return Json(number).dump(); }

Json json_of(const Eigen::Vector2d& p) { return Json::array({p.x(), p.y()}); }

Json json_of(const Arc& arc) {
  return {{"type", "arc"},
          {"center", json_of(arc.center_m)},
          {"radius", arc.radius_m},
          {"from", arc.from_rad},
          {"sweep", arc.sweep_rad + 0.0}};  // no -0.0
}

Json json_of(const Straight& straight) {
  return {{"type", "line"}, {"from", json_of(straight.from_m)}, {"to", json_of(straight.to_m)}};
}

Json json_of(const DubinsPath& path) {
  Json segments = Json::array();
  for (const DubinsSegment& segment : path.segments) {
    segments.push_back(std::visit([](const auto& one) { return json_of(one); }, segment));
  }
  return {{"word", name_of(path.word)}, {"length", path.length_m}, {"segments", segments}};
}

/// Throws NoPath, and std::invalid_argument for what is no end of a path.
Json path_of(const DubinsEnd& from, const DubinsEnd& to, double max_curvature_1_m) {
  const DubinsPath path = shortest_dubins_path(from, to);
  for (const DubinsEnd* end : {&from, &to}) {
    if (may_turn(end->radius_m, max_curvature_1_m)) continue;
    throw NoPath("no path: " + std::string(end == &from ? "radius_from" : "radius_to") + " " + text_of(end->radius_m) +
                 " m is below 1 / max_curvature = " + text_of(1.0 / max_curvature_1_m) + " m");
  }
  return json_of(path);
}

double number_at(const Json& object, const std::string& key) {
  const auto found = object.find(key);
  if (found == object.end()) throw std::invalid_argument(key + " is missing");
  if (!found->is_number()) throw std::invalid_argument(key + " is no number");
  return found->get<double>();
}

DubinsEnd end_at(const Json& object, const std::string& key, double radius_m) {
  const auto found = object.find(key);
  if (found == object.end()) throw std::invalid_argument(key + " is missing");
  if (!found->is_array() || found->size() != 3) throw std::invalid_argument(key + " is not [x, y, yaw]");
  for (const Json& number : *found) {
    if (!number.is_number()) throw std::invalid_argument(key + " is not [x, y, yaw]");
  }
  return {{(*found)[0].get<double>(), (*found)[1].get<double>()}, (*found)[2].get<double>(), radius_m};
}

void check_curvature(double max_curvature_1_m) {
  if (!(max_curvature_1_m > 0.0)) throw std::invalid_argument("max_curvature must be above 0 1/m");
}

Json answer(const std::string& line, double max_curvature_1_m) {
  try {
    const Json one = Json::parse(line);
    if (!one.is_object()) throw std::invalid_argument("the line is no object");
    const DubinsEnd from = end_at(one, "from", number_at(one, "radius_from"));
    const DubinsEnd to = end_at(one, "to", number_at(one, "radius_to"));
    if (one.contains("max_curvature")) max_curvature_1_m = number_at(one, "max_curvature");
    check_curvature(max_curvature_1_m);
    return path_of(from, to, max_curvature_1_m);
  } catch (const Json::exception&) {  // no JSON, or a number that is too large
    return {{"error", "the line is no JSON with finite numbers"}};
  } catch (const std::exception& error) {
    return {{"error", error.what()}};
  }
}

void print(const Json& line) {
  if (std::printf("%s\n", line.dump().c_str()) < 0) throw std::runtime_error("the output cannot be written");
}

void answer_all(const std::string& path, double max_curvature_1_m) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + " cannot be read");
  std::string line;
  while (std::getline(file, line)) {
    if (line.find_first_not_of(" \t\r") != std::string::npos) print(answer(line, max_curvature_1_m));
  }
  if (file.bad()) throw std::runtime_error(path + " cannot be read");
}

struct Options {
  std::string from_text, to_text, batch;
  DubinsEnd from, to;
  double max_curvature_1_m = std::numeric_limits<double>::infinity();
};

/// The path that the options ask for, or a batch: not both.
void check_options(const CommandLine& app, Options& options) {
  check_curvature(options.max_curvature_1_m);
  for (const char* option : {"--from", "--to", "--radius-from", "--radius-to"}) {
    const bool is_given = app.count(option) > 0;
    if (is_given && !options.batch.empty())
      throw CommandLineError(std::string(option) + ": has no place beside --batch");
    if (!is_given && options.batch.empty()) throw option_required(option);
  }
  if (!options.batch.empty()) return;
  const auto set_pose = [](const std::string& text, const char* source, DubinsEnd& end) {
    const Pose2 T = parse_pose2(text, source);
    end.p_m = T.translation_m;
    end.yaw_rad = T.yaw_rad;
  };
  set_pose(options.from_text, "--from", options.from);
  set_pose(options.to_text, "--to", options.to);
  shortest_dubins_path(options.from, options.to);  // refuses what is out of bounds
}

void add_options(CommandLine& app, Options& options) {
  const auto add = [&app](const char* name, auto& value, const char* type, const char* what) {
    app.add_option(name, value, what).type_name(type).default_str("");
  };
  add("--from", options.from_text, "X,Y,YAW", "where the path begins");
  add("--to", options.to_text, "X,Y,YAW", "where it ends");
  add("--radius-from", options.from.radius_m, "R", "radius of the first turn, in m");
  add("--radius-to", options.to.radius_m, "R", "radius of the last turn, in m");
  add("--max-curvature", options.max_curvature_1_m, "K",
      "greatest curvature of the vehicle, in 1/m, of --batch where a line has none");
  add("--batch", options.batch, "FILE", "instead of these: a file of cases, one line of JSON each");
  app.callback([&app, &options] { check_option([&app, &options] { check_options(app, options); }); });
}

/// The arguments with an option and its pose in one: a pose may begin with a minus, which the parser would take for
/// another option.
class JoinedPoses {
 public:
  JoinedPoses(int argc, char** argv) {
    for (int i = 0; i < argc; ++i) {
      words_.emplace_back(argv[i]);
      const bool takes_pose = words_.back() == "--from" || words_.back() == "--to";
      if (takes_pose && i + 1 < argc && argv[i + 1][0] == '-' && argv[i + 1][1] != '-') {
        words_.back() += std::string("=") + argv[++i];
      }
    }
    argv_.reserve(words_.size());
    for (std::string& word : words_) argv_.push_back(word.data());
  }
  int argc() const { return static_cast<int>(argv_.size()); }
  char** argv() { return argv_.data(); }

 private:
  std::vector<std::string> words_;
  std::vector<char*> argv_;
};

int dubins_path(const Options& options) {
  if (!options.batch.empty()) {
    answer_all(options.batch, options.max_curvature_1_m);
  } else {
    try {
      print(path_of(options.from, options.to, options.max_curvature_1_m));
    } catch (const NoPath& none) {
      std::fprintf(stderr, "%s: %s\n", kName, none.what());
      return 2;
    }
  }
  return std::fflush(stdout) == 0 ? 0 : 1;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app(kName, kDescription);
  add_options(app, options);
  JoinedPoses joined(argc, argv);
  return run_program(app, joined.argc(), joined.argv(), [&options] { return dubins_path(options); });
}
