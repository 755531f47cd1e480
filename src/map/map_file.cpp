// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map_file.hpp"

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/sha256.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

namespace situation_awareness {
namespace {

/// Of a whole file, of all but its elements, of one element, and of a file whose elements are not as they are written.
constexpr std::size_t kMaxBytes = std::size_t{512} << 20, kMaxMapBytes = std::size_t{64} << 20;
constexpr std::size_t kMaxElementBytes = std::size_t{1} << 20, kMaxOtherBytes = std::size_t{16} << 20;
/// Of what yaml-cpp reads at once: it takes up to 400 bytes for each.
constexpr std::ptrdiff_t kMaxValues = 1'500'000;
constexpr std::string_view kSeal = "sha256: ";        // the last line begins with it
constexpr std::string_view kEditedByHand = "edited";  // instead of the sum

void check_size(std::size_t bytes, std::size_t most_bytes) {
  if (bytes > most_bytes) throw std::invalid_argument("is larger than " + std::to_string(most_bytes) + " bytes");
}

/// The parts of a map's text.
struct MapParts {
  std::string map;                         ///< all but the elements; all, if these are not as they are written
  std::vector<std::string_view> elements;  ///< each the text of a list with one item
};

/// Takes the elements out, so that they can be read one by one: yaml-cpp takes twenty times their size for them.
MapParts parts_of(std::string_view content) {
  constexpr std::string_view kList = "\nelements:\n", kItem = "  -";
  MapParts parts;
  const std::size_t list = content.find(kList);
  std::size_t at = list == std::string_view::npos ? content.size() : list + kList.size();
  const auto is_item = [&](std::size_t line) {
    if (content.compare(line, kItem.size(), kItem) != 0) return false;
    const std::size_t behind = line + kItem.size();
    return behind < content.size() && (content[behind] == ' ' || content[behind] == '\n');
  };
  const auto is_inside = [&](std::size_t line) { return content[line] == ' ' || content[line] == '\n'; };
  if (at == content.size() || !is_item(at)) {
    parts.map = content;
    check_size(parts.map.size(), kMaxOtherBytes);
    return parts;
  }
  std::size_t begin = at;
  while (at < content.size() && is_inside(at)) {
    const std::size_t end_of_line = content.find('\n', at);
    at = end_of_line == std::string_view::npos ? content.size() : end_of_line + 1;
    if (at < content.size() && is_inside(at) && !is_item(at)) continue;
    parts.elements.push_back(content.substr(begin, at - begin));
    check_size(parts.elements.back().size(), kMaxElementBytes);
    begin = at;
  }
  parts.map = std::string(content.substr(0, list + 1)) + std::string(content.substr(at));
  check_size(parts.map.size(), kMaxMapBytes);
  return parts;
}

/// Everything before the last line, whose checksum must match.
std::string_view sealed_content(std::string_view yaml) {
  // The last line is looked for from the end: most files that are cut off are refused without being read.
  const bool ends = !yaml.empty() && yaml.back() == '\n';
  const std::size_t before = ends ? yaml.substr(0, yaml.size() - 1).rfind('\n') : std::string_view::npos;
  const std::string_view content = yaml.substr(0, before == std::string_view::npos ? 0 : before + 1);
  const std::string_view last_line = yaml.substr(content.size());
  if (content.empty() || last_line.substr(0, kSeal.size()) != kSeal) {
    throw std::invalid_argument("does not end with its line sha256: cut off, or no map");
  }
  const std::string_view sum = last_line.substr(kSeal.size(), last_line.size() - kSeal.size() - 1);
  if (sum != kEditedByHand && sum != sha256(content)) {
    throw std::invalid_argument(
        "its content does not have the sum of its last line: damaged (or edited, then make it '" + std::string(kSeal) +
        std::string(kEditedByHand) + "')");
  }
  return content;
}

void check_values(const std::string& text) {
  const auto separates = [](char c) { return c == ',' || c == ':' || c == '\n' || c == '[' || c == '{'; };
  if (std::count_if(text.begin(), text.end(), separates) > kMaxValues) {
    throw std::invalid_argument("has more than " + std::to_string(kMaxValues) + " values beside its elements");
  }
}

/// The one document of a text.
YAML::Node parse(const std::string& content) {
  // Not by YAML::LoadAll, which does not return for a text such as a single comma. Further documents have markers.
  const auto marked = [&](const std::string& mark) {
    return content.rfind(mark, 0) == 0 || content.find('\n' + mark) != std::string::npos;
  };
  if (marked("---") || marked("...")) throw std::invalid_argument("is not one YAML document");
  check_values(content);
  return YAML::Load(content);
}

ReadFields element_fields(std::string_view text, std::size_t i) {
  const std::string place = detail::item_place("", "elements", i);
  try {
    return {parse(std::string(text))[0], place};
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(place + yaml_defect(error));
  }
}

/// The version of a file of this kind.
std::uint64_t read_header(ReadFields& fields, const MapFileHeader& header) {
  std::string format;
  fields("format", format);
  if (format != header.format) {
    throw std::invalid_argument("format = " + format + " is not '" + header.format + "'");
  }
  std::uint64_t version = 0;
  fields("version", version);
  if (version < header.oldest_version || version > header.version) {
    throw std::invalid_argument("version = " + std::to_string(version) + " is unknown, known are " +
                                std::to_string(header.oldest_version) + " to " + std::to_string(header.version));
  }
  return version;
}

}  // namespace

void detail::check_frame(const std::string& world_frame) {
  const auto plain = [](char c) { return c > ' ' && c < 0x7F && c != '"' && c != '\\'; };
  if (world_frame.empty() || world_frame.size() > 255 || !std::all_of(world_frame.begin(), world_frame.end(), plain)) {
    throw std::invalid_argument("world_frame is no name of a frame");
  }
}

std::string detail::write_sealed(const MapFileHeader& header, const std::function<void(WriteFields&)>& write) {
  std::string text = "# " + header.title + '\n';
  WriteFields fields(text);
  fields("format", header.format);
  fields("version", header.version);
  write(fields);
  check_values(parts_of(text).map);  // what is written can be read
  const std::string sum = sha256(text);
  text += std::string(kSeal) + sum + '\n';
  check_size(text.size(), kMaxBytes);
  return text;
}

void detail::read_sealed(const std::string& yaml, const std::string& source, const MapFileHeader& header,
                         std::size_t max_elements,
                         const std::function<void(ReadFields& fields, std::uint64_t version)>& read_map,
                         const std::function<void(ReadFields& fields, std::uint64_t version)>& read_element) {
  try {
    check_size(yaml.size(), kMaxBytes);
    const MapParts parts = parts_of(sealed_content(yaml));
    ReadFields fields(parse(parts.map), "");
    const std::uint64_t version = read_header(fields, header);
    read_map(fields, version);
    if (parts.elements.size() > max_elements) {
      throw std::invalid_argument("elements are more than " + std::to_string(max_elements));
    }
    std::vector<ReadFields> others;
    if (parts.elements.empty()) others = fields.list("elements", max_elements);
    fields.refuse_rest();
    for (std::size_t i = 0; i < std::max(parts.elements.size(), others.size()); ++i) {
      ReadFields element = i < others.size() ? others[i] : element_fields(parts.elements[i], i);
      read_element(element, version);
      element.refuse_rest();
    }
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(source + ": " + yaml_defect(error));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
}

FileKind detail::kind_of(const MapFileHeader& header) {
  return {"a '" + header.format + "'", [format = header.format](std::string_view head) {
            for (const std::string quote : {"\"", ""}) {
              if (head.find("format: " + quote + format + quote + '\n') != std::string_view::npos) return true;
            }
            return false;
          }};
}

std::string detail::read_map_file(const std::string& path) { return read_file(path, kMaxBytes); }

void detail::refuse_frame(const std::string& path, const std::string& world_frame, const std::string& wanted) {
  throw std::invalid_argument(path + ": world_frame = " + world_frame + " is not the wanted one, " + wanted);
}

}  // namespace situation_awareness
