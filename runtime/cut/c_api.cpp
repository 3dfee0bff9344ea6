// SPDX-License-Identifier: MIT
//
// The C interface over cut.h. Nothing is decided here.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"
#include "sinew/runtime/cut.h"

static_assert(sizeof(sinew_cut_origin) == sizeof(sinew::CutOrigin));
static_assert(offsetof(sinew_cut_origin, b) == offsetof(sinew::CutOrigin, b));
static_assert(offsetof(sinew_cut_origin, t) == offsetof(sinew::CutOrigin, t));
static_assert(offsetof(sinew_cut_origin, c) == offsetof(sinew::CutOrigin, c));
static_assert(offsetof(sinew_cut_origin, s) == offsetof(sinew::CutOrigin, s));

struct sinew_cut {
  sinew::CutBodies made;
  std::vector<sinew_cut_heir> pin_sets, picks;
};

namespace {

using sinew::handles::failNull;
using sinew::handles::guarded;
using sinew::handles::tellFailure;

sinew_cut_settings fromCpp(const sinew::CutSettings& s) {
  sinew_cut_settings result = {};
  result.struct_size = sizeof result;
  result.spacing = s.spacing;
  result.least_part = s.least_part;
  std::copy(s.section_color.begin(), s.section_color.end(), result.section_color);
  result.close_open_surfaces = s.close_open_surfaces ? 1 : 0;
  result.keep_textures = s.keep_textures ? 1 : 0;
  return result;
}

/// \param given of an older or newer header: what it lacks keeps its default. Null: all does.
sinew::CutSettings toCpp(const sinew_cut_settings* given) {
  const sinew_cut_settings s = sinew::handles::readStruct(given, fromCpp({}));
  sinew::CutSettings result;
  result.spacing = s.spacing;
  result.least_part = s.least_part;
  std::copy(s.section_color, s.section_color + 4, result.section_color.begin());
  result.close_open_surfaces = s.close_open_surfaces != 0;
  result.keep_textures = s.keep_textures != 0;
  return result;
}

template <class Id>
std::vector<sinew_cut_heir> heirsOf(const std::vector<sinew::CutHeir<Id>>& heirs) {
  std::vector<sinew_cut_heir> result;
  for (const auto& heir : heirs) result.push_back({heir.before.value, heir.now.value, heir.body.value});
  return result;
}

sinew_status give(const char* call, const sinew_cut* cut, std::vector<sinew_cut_heir> sinew_cut::*list,
                  const sinew_cut_heir** heirs, std::uint32_t* count) {
  if (cut == nullptr || heirs == nullptr || count == nullptr) return failNull(call);
  *heirs = (cut->*list).data();
  *count = std::uint32_t((cut->*list).size());
  return SINEW_OK;
}

sinew_status failPart(const char* call) {
  return tellFailure(SINEW_ERROR_ARGUMENT, std::string(call) + ": no such part");
}

sinew_status cutAlong(sinew_world* world, std::uint32_t body, const sinew::CutPlane& plane,
                      const sinew_cut_settings* settings, sinew_cut** cut) {
  return guarded("sinew_body_cut", [&] {
    auto result = std::make_unique<sinew_cut>();
    auto made = sinew::cutBody(sinew::handles::worldOf(world), {body}, plane, toCpp(settings));
    const sinew_status told = sinew::handles::takeToldStatus();
    if (!made) {
      const bool no_memory = told == SINEW_ERROR_MEMORY || made.reason() == "out of memory";
      return tellFailure(no_memory ? SINEW_ERROR_MEMORY : SINEW_ERROR_ARGUMENT, made.reason());
    }
    result->made = std::move(*made);
    result->pin_sets = heirsOf(result->made.pin_sets);
    result->picks = heirsOf(result->made.picks);
    *cut = result.release();
    return SINEW_OK;
  });
}

}  // namespace

void sinew_cut_settings_init(sinew_cut_settings* settings, size_t struct_size) {
  sinew::handles::writeStruct(fromCpp({}), settings, struct_size);
}

sinew_status sinew_body_cut(sinew_world* world, uint32_t body, const float point[3], const float normal[3],
                            const sinew_cut_settings* settings, sinew_cut** cut) {
  if (world == nullptr || point == nullptr || normal == nullptr || cut == nullptr) return failNull("sinew_body_cut");
  return cutAlong(world, body, {sinew::handles::vec3(point), sinew::handles::vec3(normal)}, settings, cut);
}

sinew_status sinew_body_cut_bounded(sinew_world* world, uint32_t body, const float corners[12],
                                    const sinew_cut_settings* settings, sinew_cut** cut) {
  if (world == nullptr || corners == nullptr || cut == nullptr) return failNull("sinew_body_cut_bounded");
  std::array<sinew::Vec3, 4> places;
  for (std::size_t i = 0; i < 4; ++i) places[i] = sinew::handles::vec3(corners + 3 * i);
  return cutAlong(world, body, sinew::boundedPlane(places), settings, cut);
}

void sinew_cut_release(sinew_cut* cut) { delete cut; }

uint32_t sinew_cut_part_count(const sinew_cut* cut) {
  return cut != nullptr ? std::uint32_t(cut->made.bodies.size()) : 0;
}

sinew_status sinew_cut_get_part(const sinew_cut* cut, uint32_t number, sinew_cut_part* part) {
  if (cut == nullptr || part == nullptr) return failNull("sinew_cut_get_part");
  if (number >= cut->made.bodies.size()) return failPart("sinew_cut_get_part");
  const sinew::CutPart& from = cut->made.cut.parts[number];
  const std::uint32_t size = part->struct_size;
  sinew_cut_part value = {};
  value.struct_size = size;
  value.body = cut->made.bodies[number].value;
  value.above = from.above ? 1 : 0;
  value.visual_count = std::uint32_t(from.visual.size());
  value.physical_count = std::uint32_t(from.physical.size());
  value.mass = from.mass;
  value.volume = from.volume;
  value.visual = reinterpret_cast<const sinew_cut_origin*>(from.visual.data());
  value.physical = from.physical.data();
  std::memcpy(part, &value, std::min<std::size_t>(size, sizeof value));
  return SINEW_OK;
}

sinew_status sinew_cut_part_asset(const sinew_cut* cut, uint32_t number, sinew_asset** asset) {
  if (cut == nullptr || asset == nullptr) return failNull("sinew_cut_part_asset");
  if (number >= cut->made.bodies.size()) return failPart("sinew_cut_part_asset");
  return guarded("sinew_cut_part_asset", [&] {
    *asset = sinew::handles::handleOf(cut->made.cut.parts[number].asset);
    return SINEW_OK;
  });
}

sinew_status sinew_cut_pin_sets(const sinew_cut* cut, const sinew_cut_heir** heirs, uint32_t* count) {
  return give("sinew_cut_pin_sets", cut, &sinew_cut::pin_sets, heirs, count);
}

sinew_status sinew_cut_picks(const sinew_cut* cut, const sinew_cut_heir** heirs, uint32_t* count) {
  return give("sinew_cut_picks", cut, &sinew_cut::picks, heirs, count);
}
