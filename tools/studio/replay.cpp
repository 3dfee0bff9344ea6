// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/replay.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <map>

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMostWait = 60 * 300;   // frames for a bake or an evaluation
constexpr int kMostSearch = 60 * 10;  // for a control

const std::vector<std::string>& eventKinds() {
  static const std::vector<std::string> kinds = {"move", "click", "drag",  "stroke",     "wheel", "key",
                                                 "text", "wait",  "orbit", "screenshot", "pull",  "drop"};
  return kinds;
}

const std::map<std::string, int>& keyNames() {
  static const std::map<std::string, int> names = {{"enter", GLFW_KEY_ENTER},    {"escape", GLFW_KEY_ESCAPE},
                                                   {"space", GLFW_KEY_SPACE},    {"tab", GLFW_KEY_TAB},
                                                   {"f1", GLFW_KEY_F1},          {"f12", GLFW_KEY_F12},
                                                   {"[", GLFW_KEY_LEFT_BRACKET}, {"]", GLFW_KEY_RIGHT_BRACKET}};
  return names;
}

bool isPoint(const Json& json) {
  return json.is_array() && json.size() == 3 &&
         std::all_of(json.begin(), json.end(), [](const Json& x) { return x.is_number(); });
}

std::optional<Keys::Press> pressNamed(std::string name) {
  Keys::Press press;
  for (const auto& [prefix, flag] : {std::pair{std::string("control+"), &press.control}, {"shift+", &press.shift}}) {
    if (!name.starts_with(prefix)) continue;
    *flag = true;
    name.erase(0, prefix.size());
  }
  if (const auto named = keyNames().find(name); named != keyNames().end())
    press.key = named->second;
  else if (name.size() == 1 && name[0] >= 'a' && name[0] <= 'z')
    press.key = GLFW_KEY_A + (name[0] - 'a');
  else if (name.size() == 1 && name[0] >= '0' && name[0] <= '9')
    press.key = GLFW_KEY_0 + (name[0] - '0');
  else
    return std::nullopt;
  return press;
}

}  // namespace

Replay::Replay(const std::string& file) : text_(JsonText::read(file)) { check(); }

void Replay::check() const {
  const Json& json = text_.json();
  if (!json.is_object() || !json.contains("events") || !json["events"].is_array())
    text_.fail("", "is no file of events", R"(It looks like {"events": [{"click": "Paint"}, {"wait": "bake"}]}.)");
  for (std::size_t i = 0; i < json["events"].size(); ++i) {
    const Json& event = json["events"][i];
    const std::string place = childPointer("/events", i);
    const auto& kinds = eventKinds();
    if (!event.is_object() || event.empty() ||
        std::find(kinds.begin(), kinds.end(), event.begin().key()) == kinds.end()) {
      const std::string name = event.is_object() && !event.empty() ? event.begin().key() : "";
      text_.fail(place, "is no event", "Did you mean " + nearestName(name, kinds) + "?");
    }
    const std::string kind = event.begin().key();
    const Json& value = event.begin().value();
    const bool names = kind == "text" || kind == "key" || kind == "drag" || kind == "screenshot" || kind == "drop";
    if (names && !value.is_string()) text_.fail(place, kind + " wants a text", "Write the name of a control or key.");
    if (kind == "key" && !pressNamed(value.get<std::string>()))
      text_.fail(place, "there is no key " + value.dump(), "Write a letter, a digit, enter, escape, space, tab.");
    if (kind == "stroke") {
      if (!value.is_array() || value.empty() || !std::all_of(value.begin(), value.end(), isPoint))
        text_.fail(place, "a stroke wants points", "Write [[x, y, z], ...], in metres on the source.");
    }
    if (kind == "pull" && (!event.contains("by") || !event["by"].is_array() || event["by"].size() != 2))
      text_.fail(place, "pull wants pixels `by`", R"(Write {"pull": "handle radius", "by": [40, 0]}.)");
    if ((kind == "click" || kind == "move" || kind == "pull") && !value.is_string() && !isPoint(value) &&
        !(value.is_array() && value.size() == 2))
      text_.fail(place, kind + " wants a control, a pixel or a place", R"(Write "Paint", [600, 400] or [x, y, z].)");
    if ((kind == "drag") && (!event.contains("to") || !event["to"].is_number()))
      text_.fail(place, kind + " wants a number `to`", R"(Write {"drag": "channel smile.L", "to": 1}, 0..1.)");
  }
}

void Replay::fail(const std::string& what, const std::string& cure) const {
  text_.fail(childPointer("/events", next_), what, cure);
}

// So many frames on the way, as a hand would.
void Replay::glide(const Eigen::Vector2f& to, int frames) {
  Eigen::Vector2f from = mouse_;
  for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
    if (!step->move) continue;
    from = *step->move;
    break;
  }
  for (int f = 1; f <= frames; ++f) {
    Step& step = steps_.emplace_back();
    step.move = from + (to - from) * (float(f) / float(frames));
  }
}

void Replay::drag(const Eigen::Vector2f& from, const Eigen::Vector2f& to) {
  glide(from, 2);
  steps_.emplace_back().press = 0;
  glide(to, 6);
  steps_.emplace_back().release = 0;
  steps_.emplace_back().idle = 1;
}

// Makes steps of the next event. false: it waits.
bool Replay::begin(const Window& window) {
  const Json& event = text_.json()["events"][next_];
  const std::string kind = event.begin().key();
  const Json& value = event.begin().value();
  const auto boxOf = [&](const std::string& name) -> std::optional<Widgets::Box> {
    const auto box = window.widgets.find(name);
    if (!box && ++waited_ > kMostSearch)
      fail("there is no control '" + name + "' to be seen", "Open its tab first; names are the labels that are shown.");
    if (box && box->scroll != 0) {
      // As a hand would: the wheel over the panel.
      if (++waited_ > kMostSearch) fail("'" + name + "' cannot be scrolled to", "Choose a larger window.");
      steps_.emplace_back().move = Eigen::Vector2f(box->wheel_x, box->wheel_y);
      steps_.emplace_back().wheel = box->scroll > 0 ? -1.0F : 1.0F;
      steps_.emplace_back().idle = 1;
      return std::nullopt;
    }
    return box;
  };
  const auto placeOf = [&](const Json& point) {
    auto at = window.on_screen(pointOf(point));
    if (!at && ++waited_ > kMostWait) fail("the source does not come", "Look whether it can be read by itself.");
    return at;
  };
  if (kind == "wait") {
    if (value.is_number()) {
      steps_.emplace_back().idle = value.get<int>();
      return true;
    }
    const bool for_bake = value == "bake";
    if (value == "film") {
      if (window.is_filming && ++waited_ > kMostWait) fail("the film does not end", "Film a shorter scene.");
      return !window.is_filming;
    }
    if (for_bake && window.bake_failed) fail("the bake failed", "Bake the recipe by itself to see why.");
    if (for_bake ? window.is_baked : window.is_evaluated) return true;
    if (++waited_ > kMostWait)
      fail("the " + value.dump() + " does not end", "Look whether the recipe bakes by itself.");
    return false;
  }
  if (kind == "key") {
    steps_.emplace_back().key = pressNamed(value.get<std::string>());
    steps_.emplace_back().idle = 1;
  } else if (kind == "text") {
    steps_.emplace_back().text = value.get<std::string>();
    steps_.emplace_back().idle = 1;
  } else if (kind == "wheel") {
    steps_.emplace_back().wheel = value.get<float>();
  } else if (kind == "drop") {
    window.keys.drop(value.get<std::string>());
    steps_.emplace_back().idle = 2;
  } else if (kind == "screenshot") {
    window.screenshot(value.get<std::string>());
  } else if (kind == "orbit") {
    // By so many pixels, with the right button.
    const Eigen::Vector2f from(float(event.value("x", 900.0)), float(event.value("y", 400.0)));
    const Eigen::Vector2f by(value[0].get<float>(), value[1].get<float>());
    glide(from, 2);
    steps_.emplace_back().press = 1;
    glide(from + by, 8);
    steps_.emplace_back().release = 1;
  } else if (kind == "drag") {
    const auto box = boxOf(value.get<std::string>());
    if (!box) return false;
    // The grab's centre goes from half a grab inside of one end to that of the other.
    const float inset = ImGui::GetStyle().GrabMinSize / 2 + 2;
    const float y = (box->top + box->bottom) / 2;
    const auto share = event["to"].get<float>();
    const float x = box->left + inset + share * (box->right - box->left - 2 * inset);
    drag({box->left + inset, y}, {share >= 1 ? box->right - 1 : x, y});
  } else if (kind == "stroke") {
    std::vector<Eigen::Vector2f> way;
    for (const Json& p : value) {
      const auto at = placeOf(p);
      if (!at) return false;
      way.push_back(*at);
    }
    glide(way.front(), 2);
    steps_.emplace_back().press = 0;
    for (std::size_t i = 1; i < way.size(); ++i) glide(way[i], 4);
    steps_.emplace_back().idle = 1;
    steps_.emplace_back().release = 0;
    steps_.emplace_back().idle = 4;
  } else {
    Eigen::Vector2f at;
    if (value.is_string()) {
      const auto box = boxOf(value.get<std::string>());
      if (!box) return false;
      at = {std::min(box->left + 12, (box->left + box->right) / 2), (box->top + box->bottom) / 2};
    } else if (value.size() == 2) {
      at = {value[0].get<float>(), value[1].get<float>()};
    } else {
      const auto place = placeOf(value);
      if (!place) return false;
      at = *place;
    }
    glide(at, 2);
    if (kind == "pull") {
      const Eigen::Vector2f by(event["by"][0].get<float>(), event["by"][1].get<float>());
      steps_.emplace_back().press = 0;
      glide(at + by, 10);
      steps_.emplace_back().idle = event.value("hold", 1);
      if (event.contains("screenshot")) steps_.emplace_back().picture = event["screenshot"].get<std::string>();
      steps_.emplace_back().release = 0;
      steps_.emplace_back().idle = 2;
    }
    if (kind == "click") {
      const int button = event.value("button", "left") == "right" ? 1 : 0;
      steps_.emplace_back().press = button;
      steps_.emplace_back().release = button;
      steps_.emplace_back().idle = 1;
    }
  }
  return true;
}

void Replay::frame(const Window& window) {
  while (steps_.empty() && next_ < text_.json()["events"].size()) {
    if (!begin(window)) break;
    ++next_;
    waited_ = 0;
  }
  ImGuiIO& io = ImGui::GetIO();
  std::fill(std::begin(io.KeysDown), std::end(io.KeysDown), false);
  io.KeyShift = io.KeyCtrl = false;
  if (!steps_.empty()) {
    Step& step = steps_.front();
    if (step.move) mouse_ = *step.move;
    if (step.press >= 0) down_[std::size_t(step.press)] = true;
    if (step.release >= 0) down_[std::size_t(step.release)] = false;
    io.MouseWheel = step.wheel;
    if (!step.picture.empty()) window.screenshot(step.picture);
    if (!step.text.empty()) io.AddInputCharactersUTF8(step.text.c_str());
    if (step.key) {
      window.keys.press(*step.key);
      io.KeysDown[step.key->key] = true;
      io.KeyCtrl = step.key->control;
      io.KeyShift = step.key->shift;
    }
    if (--step.idle <= 0) steps_.erase(steps_.begin());
  }
  io.MousePos = {mouse_.x(), mouse_.y()};
  for (std::size_t b = 0; b < down_.size(); ++b) io.MouseDown[b] = down_[b];
}

}  // namespace sinew::tools
