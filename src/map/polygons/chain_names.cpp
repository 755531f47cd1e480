// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/chain_names.hpp"

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// Pieces of a line with at least so many elements each have grown together where they follow each other.
constexpr std::size_t kElementsOfPiece = 3;

/// The first of names, in ascending order, that is not below one.
template <class Names>
auto not_below(Names& names, std::uint64_t name) {
  return std::lower_bound(names.begin(), names.end(), name,
                          [](const auto& named, std::uint64_t wanted) { return named.name < wanted; });
}

}  // namespace

ChainNames::ChainNames() {
  for (std::vector<std::uint64_t>* ids : {&ids_, &lost_}) ids->reserve(kUsualRoom);
}

void ChainNames::begin_anew(std::uint64_t next_id) {
  next_id_ = std::max(next_id_, next_id);
  members_.clear();
  names_.clear();
  lost_.clear();
  renamed_.clear();
}

void ChainNames::begin_update(std::size_t elements, bool is_new_scan) {
  ++update_;
  were_renamed_.clear();
  if (is_new_scan) std::swap(were_renamed_, renamed_);
  if (members_.size() >= elements) return;
  make_room(members_, elements);
  members_.resize(elements);
}

std::vector<ChainNames::Named>::iterator ChainNames::place_of(std::uint64_t name) { return not_below(names_, name); }

bool ChainNames::is_marked(std::uint64_t name) const {
  const auto at = not_below(names_, name);
  return at != names_.end() && at->name == name && at->update == update_;
}

bool ChainNames::is_used(std::uint64_t name) {
  const auto at = place_of(name);
  return at != names_.end() && at->name == name && at->first != kNone;
}

/// One for each chain and each name of its elements, with how many there are.
void ChainNames::claim_ids(const Surfels& surfels, const ChainLinks& links,
                           const std::vector<ChainLinks::Run>& chains) {
  const std::vector<Index>& ordered = links.ordered();
  claims_.clear();
  for (std::size_t c = 0; c < chains.size(); ++c) {
    const std::size_t first = claims_.size();
    for (std::size_t k = chains[c].first; k < chains[c].end; ++k) {
      const std::uint64_t id = surfels[ordered[k]].chain;
      if (id == 0) continue;
      if (claims_.size() == first || claims_.back().id != id) claims_.push_back({0, id, c});
      ++claims_.back().elements;
    }
  }
}

/// Those of a chain to the same id.
void ChainNames::add_up_claims() {
  std::sort(claims_.begin(), claims_.end(),
            [](const Claim& a, const Claim& b) { return a.id != b.id ? a.id < b.id : a.chain < b.chain; });
  std::size_t different = 0;
  for (const Claim& claim : claims_) {
    const bool is_same =
        different > 0 && claims_[different - 1].id == claim.id && claims_[different - 1].chain == claim.chain;
    if (is_same) {
      claims_[different - 1].elements += claim.elements;
    } else {
      claims_[different++] = claim;
    }
  }
  claims_.erase(claims_.begin() + static_cast<std::ptrdiff_t>(different), claims_.end());
}

/// An id goes to the chain with most of the elements that were first of it; what is left of a chain gets a new one. A
/// thing that touches another one now and then has its own id back when they part.
const std::vector<std::uint64_t>& ChainNames::name(Surfels& surfels, const ChainLinks& links,
                                                   const std::vector<ChainLinks::Run>& chains, Joints& joints) {
  claim_ids(surfels, links, chains);
  add_up_claims();
  std::sort(claims_.begin(), claims_.end(), [](const Claim& a, const Claim& b) {
    if (a.elements != b.elements) return a.elements > b.elements;
    return a.id != b.id ? a.id < b.id : a.chain < b.chain;
  });
  assign_with_room(ids_, chains.size(), 0);
  taken_.clear();
  for (const Claim& claim : claims_) {
    const auto place = std::lower_bound(taken_.begin(), taken_.end(), claim.id);
    if (ids_[claim.chain] != 0 || (place != taken_.end() && *place == claim.id)) continue;
    taken_.insert(place, claim.id);
    ids_[claim.chain] = claim.id;
  }
  for (std::size_t c = 0; c < chains.size(); ++c) {
    const bool is_new = ids_[c] == 0;
    if (is_new) ids_[c] = next_id_++;
    name_elements(surfels, links, chains[c], ids_[c], is_new);
    unite_names(surfels, links, chains[c], ids_[c], joints);
  }
  std::sort(renamed_.begin(), renamed_.end());
  renamed_.erase(std::unique(renamed_.begin(), renamed_.end()), renamed_.end());
  return ids_;
}

void ChainNames::rename(Surfels& surfels, Index index, std::uint64_t name) {
  std::uint64_t& own = surfels[index].chain;
  if (own == name) return;
  if (own != 0) lost_.push_back(own);
  own = name;
  renamed_.push_back(index);
}

/// A new element gets the name of those on its side of the joints, so that what is joined can come apart again.
void ChainNames::name_elements(Surfels& surfels, const ChainLinks& links, const ChainLinks::Run& run, std::uint64_t id,
                               bool is_new) {
  const std::vector<Index>& ordered = links.ordered();
  std::uint64_t name = is_new ? id : 0;
  for (std::size_t k = run.first; k < run.end; ++k) {
    Surfel& surfel = surfels[ordered[k]];
    if (is_new || surfel.chain == 0) rename(surfels, ordered[k], name);
    if (!is_new) name = links.is_before_joint(k) ? 0 : surfel.chain;
  }
  if (is_new) return;
  for (std::size_t k = run.end; k-- > run.first;) {
    Surfel& surfel = surfels[ordered[k]];
    if (links.is_before_joint(k)) name = 0;
    if (surfel.chain == 0) rename(surfels, ordered[k], name);
    name = surfel.chain;
  }
  for (std::size_t k = run.first; k < run.end; ++k) {
    if (surfels[ordered[k]].chain == 0) rename(surfels, ordered[k], id);
  }
}

/// Chains that met for long are one: what comes apart later is new. Where pieces of a line have grown together, they
/// meet.
void ChainNames::unite_names(Surfels& surfels, const ChainLinks& links, const ChainLinks::Run& run, std::uint64_t id,
                             Joints& joints) {
  const std::vector<Index>& ordered = links.ordered();
  std::size_t begin = run.first;  // of the elements with one name on one side of the joints
  std::size_t before = 0;         // elements of the name before, on the same side
  std::uint64_t name_before = 0;
  for (std::size_t k = run.first; k < run.end; ++k) {
    const std::uint64_t name = surfels[ordered[k]].chain;
    const bool ends = k + 1 == run.end || surfels[ordered[k + 1]].chain != name || links.is_before_joint(k);
    if (!ends) continue;
    const std::size_t count = k + 1 - begin;
    if (std::min(before, count) >= kElementsOfPiece) joints.see(name_before, name, true);
    const bool at_joint = links.is_before_joint(k);
    before = at_joint ? 0 : count;
    name_before = name;
    begin = k + 1;
  }
  // The names spread from those named so, on both sides.
  const auto unite = [&](std::size_t from, std::size_t k, std::uint64_t& name_next) {
    const std::uint64_t name = surfels[ordered[k]].chain;
    const bool is_one = surfels[ordered[from]].chain == id && name != id &&
                        (joints.is_firm(name, id) || joints.is_firm(name, name_next));
    if (is_one) rename(surfels, ordered[k], id);
    name_next = name;
  };
  std::uint64_t original = surfels[ordered[run.first]].chain;
  for (std::size_t k = run.first + 1; k < run.end; ++k) unite(k - 1, k, original);
  original = surfels[ordered[run.end - 1]].chain;
  for (std::size_t k = run.end - 1; k-- > run.first;) unite(k + 1, k, original);
}

void ChainNames::count(Index index, std::uint64_t name) {
  Member& own = member(index);
  if (own.name == name) return;
  if (own.name != 0) {
    if (own.next != kNone) member(own.next).before = own.before;
    if (own.before != kNone) {
      member(own.before).next = own.next;
    } else {
      const auto before = place_of(own.name);
      before->first = own.next;
      if (before->first == kNone) lost_.push_back(own.name);
    }
  }
  own.name = name;
  own.next = own.before = kNone;
  if (name == 0) return;
  auto at = place_of(name);
  if (at == names_.end() || at->name != name) {
    at = names_.insert(at, Named{});
    at->name = name;
  }
  if (at->first != kNone) member(at->first).before = index;
  own.next = at->first;
  at->first = index;
}

void ChainNames::forget_lost(Joints& joints) {
  if (lost_.empty()) return;
  std::sort(lost_.begin(), lost_.end());
  lost_.erase(std::unique(lost_.begin(), lost_.end()), lost_.end());
  lost_.erase(std::remove_if(lost_.begin(), lost_.end(), [&](std::uint64_t name) { return is_used(name); }),
              lost_.end());
  if (lost_.empty()) return;
  joints.forget(lost_);
  names_.erase(
      std::remove_if(place_of(lost_.front()), names_.end(), [](const Named& own) { return own.first == kNone; }),
      names_.end());
  lost_.clear();
}

}  // namespace situation_awareness
