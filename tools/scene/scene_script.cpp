// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/scene_script.h"
#include "runtime/geometry/smoothstep.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <initializer_list>

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;

constexpr double kMostSeconds = 600;
constexpr std::size_t kMostHull = 64, kMostShape = 1000000;

std::string inQuotes(std::string_view name) { return "'" + std::string(name) + "'"; }

std::string list(std::span<const std::string> names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

// Reads values out of the file's JSON, and complains with the line.
class Reader {
 public:
  explicit Reader(SceneScript& script) : script_(script), text_(script.text) {}

  void run() {
    const Json& json = text_.json();
    object(json, "", {"sinew_scene", "seconds",    "step",           "still",
                      "gravity",     "iterations", "damping",        "deformation_damping_ratio",
                      "stiffness",   "channels",   "targets",        "cuts",
                      "picks",       "pushes",     "impulses",       "forces",
                      "wind",        "drag",       "self_contact",   "package_pins",
                      "colliders",   "ground",     "bodies",         "camera",
                      "levels",      "note",       "support_damping"});
    if (!json.contains("sinew_scene") || json["sinew_scene"] != 1) {
      text_.fail("/sinew_scene", "is no scene of version 1", R"(Begin it with "sinew_scene": 1.)");
    }
    script_.seconds = number(json, "", "seconds", 2, 1e-3, kMostSeconds);
    script_.still = number(json, "", "still", script_.seconds, 0, script_.seconds);
    script_.gravity = number(json, "", "gravity", 0, 0, kMostGravity);
    if (json.contains("iterations")) script_.iterations = std::uint32_t(iterations(json["iterations"]));
    if (json.contains("step")) script_.step = number(json["step"], "/step", 1e-5, 1);
    if (json.contains("damping")) script_.damping = number(json["damping"], "/damping", 0, 1e4);
    if (json.contains("support_damping")) {
      script_.support_damping = number(json["support_damping"], "/support_damping", 0, 1e4);
    }
    if (json.contains("deformation_damping_ratio")) {
      script_.deformation_damping_ratio = number(json["deformation_damping_ratio"], "/deformation_damping_ratio", 0, 1);
    }
    script_.stiffness = number(json, "", "stiffness", 1, 0, 1e6);
    if (json.contains("channels")) channels(json["channels"]);
    if (json.contains("targets")) targets(json["targets"]);
    if (json.contains("colliders")) colliders(json["colliders"]);
    if (json.contains("ground")) script_.ground = number(json["ground"], "/ground", -kMostPlace, kMostPlace);
    if (json.contains("bodies")) bodies(json["bodies"]);
    if (json.contains("cuts")) cuts(json["cuts"]);
    if (json.contains("picks")) picks(json["picks"]);
    if (json.contains("pushes")) pushes(json["pushes"]);
    if (json.contains("impulses")) impulses(json["impulses"]);
    if (json.contains("forces")) forces(json["forces"]);
    if (json.contains("wind")) script_.wind = vectorKeys(json["wind"], "/wind", "velocity");
    script_.drag = number(json, "", "drag", 0, 0, 1e4);
    if (json.contains("levels")) levels(json["levels"]);
    script_.self_contact = flag(json, "", "self_contact");
    script_.package_pins = flag(json, "", "package_pins", true);
    if (json.contains("camera")) camera(json["camera"]);
  }

 private:
  void object(const Json& json, const std::string& pointer, std::initializer_list<std::string> keys) const {
    if (!json.is_object()) text_.fail(pointer, "is no object", "Write { \"key\": value, ... }.");
    const std::vector<std::string> known(keys);
    for (const auto& [key, value] : json.items()) {
      if (std::find(known.begin(), known.end(), key) != known.end()) continue;
      text_.fail(childPointer(pointer, key), "there is no key " + inQuotes(key) + " here",
                 "Did you mean " + nearestName(key, known) + "? Keys: " + list(known) + ".");
    }
  }

  bool flag(const Json& from, const std::string& pointer, const std::string& key, bool otherwise = false) const {
    if (!from.contains(key)) return otherwise;
    if (!from[key].is_boolean()) text_.fail(childPointer(pointer, key), "needs true or false", "");
    return from[key].get<bool>();
  }

  double number(const Json& value, const std::string& pointer, double low, double high) const {
    const double x = value.is_number() ? value.get<double>() : std::nan("");
    if (!(x >= low && x <= high)) {
      Json range = {low, high};
      text_.fail(pointer, value.is_number() ? "is a number, but cannot be " + value.dump() : "needs a number",
                 "Legal: " + range[0].dump() + " to " + range[1].dump() + ".");
    }
    return x;
  }
  double number(const Json& object, const std::string& pointer, const char* key, double otherwise, double low,
                double high) const {
    return object.contains(key) ? number(object[key], childPointer(pointer, key), low, high) : otherwise;
  }

  std::array<double, 3> point(const Json& object, const std::string& pointer, const char* key) const {
    return object.contains(key) ? pointAt(object[key], childPointer(pointer, key)) : std::array<double, 3>{};
  }
  std::array<double, 3> pointAt(const Json& value, const std::string& place) const {
    if (!value.is_array() || value.size() != 3) text_.fail(place, "needs three numbers", "Write [x, y, z].");
    std::array<double, 3> result{};
    for (std::size_t i = 0; i < 3; ++i) result[i] = number(value[i], childPointer(place, i), -kMostPlace, kMostPlace);
    return result;
  }

  double iterations(const Json& value) const {
    const double count = number(value, "/iterations", 1, 16);
    if (count != std::floor(count)) text_.fail("/iterations", "needs a whole number", "Legal: 1 to 16.");
    return count;
  }

  void filled(const Json& value, const std::string& pointer, const std::string& cure) const {
    if (!value.is_array() || value.empty()) text_.fail(pointer, "needs a list of keyframes", cure);
  }
  void ascending(double before, double time, const std::string& pointer) const {
    if (time <= before) text_.fail(pointer, "a keyframe is not later than the one before", "Sort them by time.");
  }

  void channels(const Json& json) {
    if (!json.is_object()) text_.fail("/channels", "is no object", "Write channels by name.");
    for (const auto& [name, keys] : json.items()) {
      const std::string place = childPointer("/channels", name);
      filled(keys, place, "Write [[seconds, value], ...], values 0 to 1.");
      SceneScript::Channel channel{name, {}};
      for (std::size_t k = 0; k < keys.size(); ++k) {
        const std::string at = childPointer(place, k);
        if (!keys[k].is_array() || keys[k].size() != 2) {
          text_.fail(at, "a keyframe of a channel is [seconds, value]", "Write for instance [0.4, 1].");
        }
        const SceneScript::ChannelKey key = {number(keys[k][0], childPointer(at, 0), 0, kMostSeconds),
                                             number(keys[k][1], childPointer(at, 1), 0, 1)};
        if (k > 0) ascending(channel.keys.back().time, key.time, at);
        channel.keys.push_back(key);
      }
      script_.channels.push_back(std::move(channel));
    }
  }

  void targets(const Json& json) {
    if (!json.is_object()) text_.fail("/targets", "is no object", "Write targets by name.");
    for (const auto& [name, value] : json.items()) {
      const std::string place = childPointer("/targets", name);
      object(value, place, {"axis", "point", "keys", "note"});
      SceneScript::Target target = motion(value, place, {0, 0, 0});
      target.name = name;
      script_.targets.push_back(std::move(target));
    }
  }

  /// A hinge's motion. \param about where the axis is if nothing says so.
  SceneScript::Target motion(const Json& value, const std::string& place, const std::array<double, 3>& about) const {
    SceneScript::Target target;
    target.point = value.contains("point") ? point(value, place, "point") : about;
    target.axis = unitVector(value, place, "axis", target.axis);
    const std::string at = childPointer(place, "keys");
    const std::string cure = R"(Write [{"time": seconds, "turn": degrees, "move": [x, y, z]}, ...].)";
    filled(value.contains("keys") ? value["keys"] : Json(), at, cure);
    for (std::size_t k = 0; k < value["keys"].size(); ++k) {
      const Json& entry = value["keys"][k];
      const std::string here = childPointer(at, k);
      object(entry, here, {"time", "turn", "move", "note"});
      if (!entry.contains("time")) text_.fail(here, "a keyframe needs a time", cure);
      const SceneScript::TargetKey key = {number(entry, here, "time", 0, 0, kMostSeconds),
                                          number(entry, here, "turn", 0, -360, 360) * kDegree,
                                          point(entry, here, "move")};
      if (k > 0) ascending(target.keys.back().time, key.time, here);
      target.keys.push_back(key);
    }
    return target;
  }

  std::array<double, 3> unitVector(const Json& json, const std::string& pointer, const char* key,
                                   const std::array<double, 3>& usual) const {
    if (!json.contains(key)) return usual;
    std::array<double, 3> v = point(json, pointer, key);
    const double length = std::hypot(v[0], v[1], v[2]);
    if (!(length > 0)) text_.fail(childPointer(pointer, key), "an axis needs a direction", "Give [1, 0, 0].");
    for (double& x : v) x /= length;
    return v;
  }

  void colliders(const Json& json) {
    const std::string cure =
        R"(Write [{"sphere": {"radius": m}, "at": [x, y, z]}, ...]; shapes: plane, sphere, capsule, box, hull, mesh, heights.)";
    each(json, "/colliders",
         {"plane", "sphere", "capsule", "box", "hull", "mesh", "heights", "at", "axis", "point", "keys", "friction",
          "restitution", "surface_velocity", "note"},
         [&](const Json& from, const std::string& here) {
           SceneScript::Solid solid;
           int shapes = 0;
           for (const char* name : {"plane", "sphere", "capsule", "box", "hull", "mesh", "heights"}) {
             if (!from.contains(name)) continue;
             ++shapes;
             shape(name, from[name], childPointer(here, name), solid);
           }
           if (shapes != 1) text_.fail(here, "a collider needs one shape", cure);
           solid.at = point(from, here, "at");
           if (from.contains("keys")) {
             solid.motion = motion(from, here, solid.at);
           } else if (from.contains("axis") || from.contains("point")) {
             text_.fail(here, "has an axis but no keys", R"(Give "keys": [{"time": s, "turn": degrees}, ...].)");
           }
           solid.friction = number(from, here, "friction", 0.6, 0, kMostFriction);
           solid.restitution = number(from, here, "restitution", 0, 0, 1);
           if (from.contains("surface_velocity")) solid.surface_velocity = point(from, here, "surface_velocity");
           script_.colliders.push_back(std::move(solid));
         });
  }

  void shape(const std::string& name, const Json& json, const std::string& here, SceneScript::Solid& solid) const {
    const auto length = [&](const char* key) {
      if (!json.contains(key)) text_.fail(here, std::string("needs a ") + key, "Give metres.");
      return float(number(json, here, key, 0, kLeastLength, kMostPlace));
    };
    if (name == "plane") {
      object(json, here, {"normal", "note"});
      const std::array<double, 3> n = unitVector(json, here, "normal", {0, 1, 0});
      solid.base = PlaneShape{{float(n[0]), float(n[1]), float(n[2])}, 0};
    } else if (name == "sphere") {
      object(json, here, {"radius", "note"});
      solid.base = SphereShape{length("radius")};
    } else if (name == "capsule") {
      object(json, here, {"radius", "half_length", "note"});
      solid.base = CapsuleShape{length("radius"), length("half_length")};
    } else if (name == "box") {
      object(json, here, {"half_size", "note"});
      const std::array<double, 3> half = point(json, here, "half_size");
      for (const double x : half) {
        if (!(x >= kLeastLength)) text_.fail(here, "half_size needs three lengths above 0", "Give [0.5, 0.5, 0.5].");
      }
      solid.base = BoxShape{{float(half[0]), float(half[1]), float(half[2])}};
    } else if (name == "hull") {
      object(json, here, {"points", "note"});
      solid.base = HullShape{};
      points(json, here, "points", 4, kMostHull, solid.points);
    } else if (name == "mesh") {
      object(json, here, {"points", "triangles", "note"});
      solid.base = MeshShape{};
      points(json, here, "points", 3, kMostShape, solid.points);
      for (const std::array<double, 3>& t : triples(json, here, "triangles", 1)) {
        formats::Triangle triangle;
        for (std::size_t i = 0; i < 3; ++i) {
          if (!(t[i] >= 0 && t[i] < double(solid.points.size()) && t[i] == std::floor(t[i]))) {
            text_.fail(childPointer(here, "triangles"), "a corner is no number of a point", "They count from 0.");
          }
          triangle[i] = std::uint32_t(t[i]);
        }
        solid.triangles.push_back(triangle);
      }
    } else {
      object(json, here, {"heights", "columns", "cell", "note"});
      HeightFieldShape field;
      field.cell = length("cell");
      const Json& heights = json.contains("heights") ? json["heights"] : Json();
      field.columns = std::uint32_t(number(json, here, "columns", 0, 2, 4096));
      if (!heights.is_array() || heights.size() > kMostShape || heights.size() < 2 * field.columns ||
          heights.size() % field.columns != 0) {
        text_.fail(here, "needs heights in two rows of `columns` or more",
                   "Give {\"columns\": 2, \"cell\": m, \"heights\": [0, 0, 0, 0]}.");
      }
      for (std::size_t i = 0; i < heights.size(); ++i) {
        solid.heights.push_back(
            float(number(heights[i], childPointer(childPointer(here, "heights"), i), -kMostPlace, kMostPlace)));
      }
      solid.base = field;
    }
  }

  std::vector<std::array<double, 3>> triples(const Json& json, const std::string& pointer, const char* key,
                                             std::size_t least, std::size_t most = kMostShape) const {
    const std::string here = childPointer(pointer, key);
    const Json& from = json.contains(key) ? json[key] : Json();
    if (!from.is_array() || from.size() < least || from.size() > most) {
      text_.fail(json.contains(key) ? here : pointer,
                 "needs " + std::to_string(least) + " to " + std::to_string(most) + " " + key,
                 "Write [[x, y, z], ...].");
    }
    std::vector<std::array<double, 3>> result;
    for (std::size_t i = 0; i < from.size(); ++i) result.push_back(pointAt(from[i], childPointer(here, i)));
    return result;
  }
  void points(const Json& json, const std::string& pointer, const char* key, std::size_t least, std::size_t most,
              std::vector<Vec3>& to) const {
    for (const std::array<double, 3>& p : triples(json, pointer, key, least, most)) {
      to.push_back({float(p[0]), float(p[1]), float(p[2])});
    }
  }

  void bodies(const Json& json) {
    each(json, "/bodies", {"package", "move", "axis", "turn", "velocity", "note"},
         [&](const Json& from, const std::string& here) {
           SceneScript::Place place;
           const double package = number(from, here, "package", 0, 0, 1e6);
           if (package != std::floor(package)) {
             text_.fail(childPointer(here, "package"), "needs a whole number", "Packages count from 0.");
           }
           place.package = std::uint32_t(package);
           place.move = point(from, here, "move");
           place.axis = unitVector(from, here, "axis", place.axis);
           place.turn = number(from, here, "turn", 0, -3600, 3600) * kDegree;
           place.velocity = point(from, here, "velocity");
           script_.bodies.push_back(place);
         });
    if (script_.bodies.empty()) text_.fail("/bodies", "has no body", "Leave it out for one where its source is.");
  }

  void cuts(const Json& json) {
    const std::string cure =
        R"(Write [{"time": seconds, "point": [x, y, z], "normal": [x, y, z]}, ...], or "corners" of four points.)";
    filled(json, "/cuts", cure);
    for (std::size_t k = 0; k < json.size(); ++k) {
      const std::string here = childPointer("/cuts", k);
      object(json[k], here, {"time", "point", "normal", "corners", "note"});
      if (!json[k].contains("time") || json[k].contains("normal") == json[k].contains("corners")) {
        text_.fail(here, "a cut needs a time and the normal of its plane, or its corners", cure);
      }
      SceneScript::Cut cut = {number(json[k], here, "time", 0, 0, kMostSeconds), point(json[k], here, "point"),
                              point(json[k], here, "normal")};
      if (json[k].contains("corners")) {
        cut.corners = corners(json[k]["corners"], childPointer(here, "corners"));
      } else if (!(std::hypot(cut.normal[0], cut.normal[1], cut.normal[2]) > 0)) {
        text_.fail(childPointer(here, "normal"), "a plane needs a direction", "Give [0, 1, 0].");
      }
      if (k > 0 && cut.time < script_.cuts.back().time) {
        text_.fail(here, "a cut is earlier than the one before", "Sort them by time.");
      }
      script_.cuts.push_back(cut);
    }
  }

  std::array<std::array<double, 3>, 4> corners(const Json& json, const std::string& here) const {
    if (!json.is_array() || json.size() != 4) {
      text_.fail(here, "a quadrilateral has four corners", "Write [[x, y, z], [x, y, z], [x, y, z], [x, y, z]].");
    }
    std::array<std::array<double, 3>, 4> result;
    for (std::size_t i = 0; i < 4; ++i) result[i] = pointAt(json[i], childPointer(here, i));
    return result;
  }

  std::vector<SceneScript::VectorKey> vectorKeys(const Json& json, const std::string& pointer, const char* name) const {
    const std::string cure = std::string("Write [{\"time\": seconds, \"") + name + "\": [x, y, z]}, ...].";
    filled(json, pointer, cure);
    std::vector<SceneScript::VectorKey> keys;
    for (std::size_t k = 0; k < json.size(); ++k) {
      const std::string here = childPointer(pointer, k);
      object(json[k], here, {"time", name, "note"});
      if (!json[k].contains("time")) text_.fail(here, "a keyframe needs a time", cure);
      const SceneScript::VectorKey key = {number(json[k], here, "time", 0, 0, kMostSeconds),
                                          point(json[k], here, name)};
      if (k > 0) ascending(keys.back().time, key.time, here);
      keys.push_back(key);
    }
    return keys;
  }
  std::vector<SceneScript::VectorKey> keysOf(const Json& json, const std::string& pointer, const char* name) const {
    return vectorKeys(json.contains("keys") ? json["keys"] : Json(), childPointer(pointer, "keys"), name);
  }
  std::optional<std::array<double, 3>> perhaps(const Json& json, const std::string& pointer, const char* key) const {
    if (!json.contains(key)) return std::nullopt;
    return point(json, pointer, key);
  }
  /// Calls visit(object, its place) for each object of a list.
  template <class Visit>
  void each(const Json& json, const std::string& pointer, std::initializer_list<std::string> keys, const Visit& visit) {
    if (!json.is_array()) text_.fail(pointer, "is no list", "Write [{...}, ...].");
    for (std::size_t k = 0; k < json.size(); ++k) {
      const std::string here = childPointer(pointer, k);
      object(json[k], here, keys);
      visit(json[k], here);
    }
  }

  void picks(const Json& json) {
    each(json, "/picks", {"at", "direction", "keys", "frequency_hz", "most_force", "lock", "release", "note"},
         [&](const Json& from, const std::string& here) {
           if (!from.contains("at")) text_.fail(here, "a pick needs a place", "Give \"at\": [x, y, z].");
           SceneScript::Pick pick;
           pick.at = point(from, here, "at");
           pick.direction = perhaps(from, here, "direction");
           if (pick.direction && !(std::hypot((*pick.direction)[0], (*pick.direction)[1], (*pick.direction)[2]) > 0)) {
             text_.fail(childPointer(here, "direction"), "a ray needs a direction", "Give [0, 0, -1].");
           }
           pick.keys = keysOf(from, here, "move");
           pick.frequency_hz = number(from, here, "frequency_hz", 4, 0.1, 100);
           pick.most_force = number(from, here, "most_force", 0, 0, 1e12);
           pick.lock = flag(from, here, "lock");
           if (from.contains("release")) pick.release = number(from, here, "release", 0, 0, kMostSeconds);
           script_.picks.push_back(std::move(pick));
         });
  }

  void pushes(const Json& json) {
    each(json, "/pushes", {"radius", "speed", "mass", "keys", "note"}, [&](const Json& from, const std::string& here) {
      SceneScript::Push push;
      if (!from.contains("radius")) text_.fail(here, "a sphere needs a radius", "Give \"radius\": metres.");
      push.radius = number(from, here, "radius", 0, 1e-9, kMostPlace);
      push.speed = number(from, here, "speed", 1e9, 1e-9, 1e9);
      push.mass = number(from, here, "mass", 0, 0, 1e12);
      push.keys = keysOf(from, here, "at");
      script_.pushes.push_back(std::move(push));
    });
  }

  void levels(const Json& json) {
    each(json, "/levels", {"time", "level", "note"}, [&](const Json& from, const std::string& here) {
      if (!from.contains("level") || !from["level"].is_number_integer()) {
        text_.fail(here, "a level needs a whole number", R"(Give "level": 0 for all functions, 1 for half of them.)");
      }
      const SceneScript::Level level = {number(from, here, "time", 0, 0, kMostSeconds),
                                        std::uint32_t(number(from, here, "level", 0, 0, 4))};
      if (!script_.levels.empty() && level.time < script_.levels.back().time) {
        text_.fail(here, "a level is earlier than the one before", "Sort them by time.");
      }
      script_.levels.push_back(level);
    });
  }

  void impulses(const Json& json) {
    each(json, "/impulses", {"time", "at", "impulse", "note"}, [&](const Json& from, const std::string& here) {
      if (!from.contains("time") || !from.contains("impulse")) {
        text_.fail(here, "an impulse needs a time and a vector", "Give \"time\" and \"impulse\": [x, y, z], N s.");
      }
      const SceneScript::Impulse impulse = {number(from, here, "time", 0, 0, kMostSeconds), perhaps(from, here, "at"),
                                            point(from, here, "impulse")};
      if (!script_.impulses.empty() && impulse.time < script_.impulses.back().time) {
        text_.fail(here, "an impulse is earlier than the one before", "Sort them by time.");
      }
      script_.impulses.push_back(impulse);
    });
  }

  void forces(const Json& json) {
    each(json, "/forces", {"at", "keys", "note"}, [&](const Json& from, const std::string& here) {
      script_.forces.push_back({perhaps(from, here, "at"), keysOf(from, here, "force")});
    });
  }

  void camera(const Json& json) {
    object(json, "/camera", {"yaw", "pitch", "at", "height", "note"});
    SceneScript::View view;
    view.yaw = number(json, "/camera", "yaw", 0, -360, 360) * kDegree;
    view.pitch = number(json, "/camera", "pitch", 0, -kMostPitch, kMostPitch) * kDegree;
    if (json.contains("at") != json.contains("height")) {
      text_.fail("/camera", "at and height go together", "Give both, or none to show the whole body.");
    }
    if (json.contains("at")) view.at = point(json, "/camera", "at");
    view.height = number(json, "/camera", "height", 0, 1e-6, kMostPlace);
    script_.view = view;
  }

  SceneScript& script_;
  const JsonText& text_;
};

// The key before a time, and how far it is on to the next, 0..1 and smooth.
template <class Key>
std::pair<std::size_t, double> placeOf(std::span<const Key> keys, double time) {
  if (time <= keys.front().time) return {0, 0};
  std::size_t k = 0;
  while (k + 1 < keys.size() && keys[k + 1].time <= time) ++k;
  if (k + 1 == keys.size()) return {k, 0};
  return {k, geometry::smoothstep((time - keys[k].time) / (keys[k + 1].time - keys[k].time))};
}

bool matches(std::string_view pattern, std::string_view name) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == name;
  const std::string_view begin = pattern.substr(0, star), end = pattern.substr(star + 1);
  return name.size() >= begin.size() + end.size() && name.starts_with(begin) && name.ends_with(end);
}

}  // namespace

ColliderShape SceneScript::Solid::shape() const {
  ColliderShape result = base;
  if (auto* hull = std::get_if<HullShape>(&result)) hull->points = points;
  if (auto* mesh = std::get_if<MeshShape>(&result)) {
    mesh->positions = points;
    mesh->triangles = triangles;
  }
  if (auto* field = std::get_if<HeightFieldShape>(&result)) field->heights = heights;
  return result;
}

SceneScript SceneScript::read(const std::string& file) {
  SceneScript script;
  script.name = std::filesystem::path(file).stem().string();
  script.text = JsonText::read(file);
  Reader(script).run();
  return script;
}

Needs neededBy(const SceneScript& script) {
  Needs needs = Needs::none();
  for (const Need always : {Need::pins, Need::plasticity, Need::normals, Need::uvs, Need::colors, Need::textures}) {
    needs = needs.with(always);
  }
  const bool touches = script.ground || script.self_contact || script.bodies.size() > 1 || !script.colliders.empty() ||
                       !script.pushes.empty() || !script.cuts.empty();
  if (touches) needs = needs.with(Need::contact);
  if (!script.cuts.empty()) needs = needs.with(Need::cut);
  if (!script.channels.empty()) needs = needs.with(Need::activation);
  return needs;
}

double valueAt(std::span<const SceneScript::ChannelKey> keys, double time) {
  const auto [k, part] = placeOf(keys, time);
  return part > 0 ? keys[k].value + part * (keys[k + 1].value - keys[k].value) : keys[k].value;
}

std::array<double, 3> valueAt(std::span<const SceneScript::VectorKey> keys, double time) {
  const auto [k, part] = placeOf(keys, time);
  std::array<double, 3> value = keys[k].value;
  for (std::size_t a = 0; a < 3 && part > 0; ++a) value[a] += part * (keys[k + 1].value[a] - value[a]);
  return value;
}

RigidTransform motionAt(const SceneScript::Target& target, const std::array<double, 3>& origin, double time) {
  const auto [k, part] = placeOf(std::span<const SceneScript::TargetKey>(target.keys), time);
  const SceneScript::TargetKey& from = target.keys[k];
  const SceneScript::TargetKey& to = part > 0 ? target.keys[k + 1] : from;
  const Vector3d point = Vector3d(target.point.data()) - Vector3d(origin.data());
  const Vector3d move = Vector3d(from.move.data()) + part * (Vector3d(to.move.data()) - Vector3d(from.move.data()));
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(from.turn + part * (to.turn - from.turn), Vector3d(target.axis.data())).toRotationMatrix();
  const Vector3d shift = point - turn * point + move;
  RigidTransform motion;
  for (int r = 0; r < 3; ++r) {
    motion.position[std::size_t(r)] = float(shift[r]);
    for (int c = 0; c < 3; ++c) motion.rotation[3 * std::size_t(r) + std::size_t(c)] = float(turn(r, c));
  }
  return motion;
}

SceneDrive::SceneDrive(const SceneScript& from, const formats::PackageView& package) : script(from) {
  std::copy(std::begin(package.info().origin), std::end(package.info().origin), origin.begin());
  std::vector<std::string> names;
  for (const auto& channel : package.channels()) names.emplace_back(package.text(channel.name));
  for (std::size_t s = 0; s < script.channels.size(); ++s) {
    const std::string& wanted = script.channels[s].name;
    const std::size_t before = channels.size();
    for (std::uint32_t c = 0; c < names.size(); ++c) {
      if (matches(wanted, names[c])) channels.push_back({c, s});
    }
    if (channels.size() > before) continue;
    const std::string near = nearestName(wanted, names);
    script.text.fail(
        childPointer("/channels", wanted), "the package has no channel " + inQuotes(wanted),
        near.empty() ? "It has none; give a cluster of its recipe a channel." : "Did you mean " + near + "?");
  }
  names.clear();
  for (const auto& set : package.pinSets()) names.emplace_back(package.text(set.target));
  for (const SceneScript::Target& target : script.targets) {
    if (std::find(names.begin(), names.end(), target.name) != names.end()) continue;
    const std::string near = nearestName(target.name, names);
    script.text.fail(childPointer("/targets", target.name), "no pin of the package follows " + inQuotes(target.name),
                     near.empty() ? "Its recipe has no pins." : "Did you mean " + near + "?");
  }
}

void SceneDrive::readInputs(double time, std::span<float> inputs) const {
  for (const Use& use : channels) inputs[use.channel] = float(valueAt(script.channels[use.source].keys, time));
}

void SceneDrive::moveTargets(World& world, BodyId body, double time) const {
  for (const SceneScript::Target& target : script.targets) {
    world.movePinTarget(body, target.name, motionAt(target, origin, time));
  }
}

}  // namespace sinew::tools
