// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "situation_awareness/common/file.hpp"
#include "situation_awareness/map/map_fields.hpp"

namespace situation_awareness {

/// The header of the files of one kind of map.
struct MapFileHeader {
  std::string title;   ///< the first line, a readable comment
  std::string format;  ///< "situation_awareness map": the field `format`, which distinguishes the kinds
  std::uint64_t version = 1;
  std::uint64_t oldest_version = 1;  ///< that can still be read
};

/// A map of any kind in a readable file (docs/map_file.md): header, fields of the whole map, elements. Numbers are read
/// back bit for bit. The last line has the SHA-256 of everything before it, to detect truncated and damaged files.
/// `Format` is specific to the kind:
///
///     using Snapshot = MapSnapshot;  // state of the map: fields() (map_fields.hpp) of all but the elements,
///                                    // `elements`, `world_frame`, validate(), which throws std::invalid_argument
///     static constexpr std::size_t kMaxElements = 2000;
///     static MapFileHeader header();
///     static std::string comment_on(const Element& element);  // for people, before each element
///     static void read(Snapshot& snapshot, ReadFields& fields, std::uint64_t version);  // its own fields()
///     static void read(Element& element, ReadFields& fields, std::uint64_t version, const Snapshot& snapshot);
///
/// In `read`, the snapshot has its own fields, but not all elements yet.
template <class Format>
struct MapFile {
  using Snapshot = typename Format::Snapshot;

  /// Throws std::invalid_argument as Snapshot::validate, or if the world frame is not a name, so that every written
  /// file can be read.
  static std::string to_yaml(const Snapshot& snapshot);

  /// Throws std::invalid_argument naming `source`, element and field if this is no valid map of the kind: see
  /// Snapshot::validate; and each field must be there exactly once, and no other.
  static Snapshot from_yaml(const std::string& yaml, const std::string& source);

  /// Writes the file atomically: an existing one is replaced only when the new one is complete. Throws
  /// std::invalid_argument as to_yaml, and std::runtime_error naming a path that cannot be written or whose file is no
  /// map of the kind.
  static void save(const std::string& path, const Snapshot& snapshot);

  /// Throws std::invalid_argument as from_yaml, and std::runtime_error naming a path that cannot be read.
  static Snapshot load(const std::string& path);

  /// The same; a map in another frame is refused, too.
  static Snapshot load(const std::string& path, const std::string& world_frame);
};

// --- implementation -------------------------------------------------------------------------------------------------

namespace detail {

/// Throws std::invalid_argument if it is not the name of a frame.
void check_frame(const std::string& world_frame);

/// The text: the header, the fields by `write`, and the last line.
std::string write_sealed(const MapFileHeader& header, const std::function<void(WriteFields&)>& write);

/// Checks the common parts of all maps, calls `read_map` for the fields after the header, and then `read_element` for
/// those of each element.
void read_sealed(const std::string& yaml, const std::string& source, const MapFileHeader& header,
                 std::size_t max_elements,
                 const std::function<void(ReadFields& fields, std::uint64_t version)>& read_map,
                 const std::function<void(ReadFields& fields, std::uint64_t version)>& read_element);

FileKind kind_of(const MapFileHeader& header);

std::string read_map_file(const std::string& path);

[[noreturn]] void refuse_frame(const std::string& path, const std::string& world_frame, const std::string& wanted);

}  // namespace detail

template <class Format>
std::string MapFile<Format>::to_yaml(const Snapshot& snapshot) {
  detail::check_frame(snapshot.world_frame);
  snapshot.validate();
  return detail::write_sealed(Format::header(), [&](WriteFields& fields) {
    Snapshot::fields(snapshot, fields);
    fields.list("elements", snapshot.elements, Format::comment_on);
  });
}

template <class Format>
typename MapFile<Format>::Snapshot MapFile<Format>::from_yaml(const std::string& yaml, const std::string& source) {
  Snapshot snapshot;
  detail::read_sealed(
      yaml, source, Format::header(), Format::kMaxElements,
      [&](ReadFields& fields, std::uint64_t version) { Format::read(snapshot, fields, version); },
      [&](ReadFields& fields, std::uint64_t version) {
        Format::read(snapshot.elements.emplace_back(), fields, version, snapshot);
      });
  try {
    detail::check_frame(snapshot.world_frame);
    snapshot.validate();
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
  return snapshot;
}

template <class Format>
void MapFile<Format>::save(const std::string& path, const Snapshot& snapshot) {
  replace_file(path, detail::kind_of(Format::header()), to_yaml(snapshot));
}

template <class Format>
typename MapFile<Format>::Snapshot MapFile<Format>::load(const std::string& path) {
  return from_yaml(detail::read_map_file(path), path);
}

template <class Format>
typename MapFile<Format>::Snapshot MapFile<Format>::load(const std::string& path, const std::string& world_frame) {
  Snapshot snapshot = load(path);
  if (snapshot.world_frame != world_frame) detail::refuse_frame(path, snapshot.world_frame, world_frame);
  return snapshot;
}

}  // namespace situation_awareness
