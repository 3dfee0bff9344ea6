// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_input.h"

#include <imgui.h>

#include <Eigen/Geometry>

#include <utility>
#include <vector>

#include "tools/render/front.h"
#include "tools/studio/orbit.h"

namespace sinew::tools {
namespace {

constexpr float kBallRadius = 0.06F, kBallNotch = 0.02F;  // diagonals, and diagonals a notch of the wheel
constexpr float kTargetReach = 0.02F;                     // of the distance to the eye
constexpr float kTurnNotch = 0.1F;                        // rad
constexpr float kShortestCut = 0.01F;                     // rad: what is shorter was a click

bool isMoving() {
  const ImVec2 by = ImGui::GetIO().MouseDelta;
  return by.x != 0 || by.y != 0;
}

}  // namespace

void ViewInput::frame(const ViewLayout& layout, Navigation navigation, const Commands& commands, Play& play,
                      Shown& shown) {
  for (const Command command : commands) run(command, layout, play, shown);
  if (std::exchange(play.is_new, false)) fit(layout, play, ViewName::front, true);
  mouse(layout, navigation, play);
}

void ViewInput::fit(const ViewLayout& layout, const Play& play, ViewName view, bool as_scene) {
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3f& p : std::span(play.shape().positions).first(play.shape().body_vertices)) {
    points.push_back(p / play.diagonal());
    if (play.scene().hasGround())
      points.emplace_back(p.x() / play.diagonal(), play.scene().groundHeight() / play.diagonal(),
                          p.z() / play.diagonal());
  }
  for (const SceneSolid& solid : play.scene().solids()) {
    if (solid.mesh->endless) continue;
    const RigidTransform at = play.scene().world().colliderPose(solid.id);
    const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> turn(at.rotation.data());
    const Eigen::Map<const Eigen::Vector3f> from(at.position.data());
    for (const Vec3& x : solid.mesh->positions)
      points.push_back((turn * Eigen::Map<const Eigen::Vector3f>(x.data()) + from) / play.diagonal());
  }
  camera_ = viewCamera(view, frontYaw(play.package()));
  const SceneChoice& scene = play.scene().options().scene;
  const bool framed =
      as_scene && scene.script && scene.script->view && lookAsScene(camera_, *scene.script->view, play.package());
  if (!framed) fitCamera(camera_, points, layout.aspect(), 0.25F);
}

void ViewInput::run(Command command, const ViewLayout& layout, Play& play, Shown& shown) {
  switch (command) {
    case Command::play:
      play.playing = !play.playing;
      break;
    case Command::step:
      play.stepPaused();
      break;
    case Command::step_back:
      play.stepBack();
      break;
    case Command::restart:
      play.restart();
      break;
    case Command::fit:
      fit(layout, play, ViewName::front, true);
      break;
    case Command::front:
      fit(layout, play, ViewName::front, false);
      break;
    case Command::side:
      fit(layout, play, ViewName::side, false);
      break;
    case Command::top:
      fit(layout, play, ViewName::top, false);
      break;
    case Command::pull:
      play.hand = HandTool::pull;
      break;
    case Command::push:
      play.hand = HandTool::push;
      break;
    case Command::cut:
      play.hand = HandTool::cut;
      break;
    case Command::target:
      play.hand = HandTool::target;
      break;
    case Command::lock:
      play.lock();
      break;
    case Command::let_go:
      play.releaseAll();
      break;
    case Command::physical:
      shown.physical = !shown.physical;
      break;
    case Command::clusters:
      shown.clusters = !shown.clusters;
      break;
    case Command::contacts:
      shown.contacts = !shown.contacts;
      break;
    case Command::section:
      shown.section.shown = !shown.section.shown;
      break;
    default:
      if (command >= Command::scene && command <= Command::scene_last)
        play.start(static_cast<SceneKind>(int(command) - int(Command::scene)));
      break;
  }
}

void ViewInput::mouse(const ViewLayout& layout, Navigation navigation, Play& play) {
  const ImGuiIO& io = ImGui::GetIO();
  const bool over_view = !io.WantCaptureMouse;
  const Eigen::Vector3f ray = mouseRay(layout, camera_);
  const bool looks = mouse_.begin(navigation, over_view);
  if (over_view && !looks && ImGui::IsMouseClicked(ImGuiMouseButton_Left) && !takeSolid(layout, play) &&
      !takeHold(ray, play))
    mouse_.leaveLeft();
  const bool left = ImGui::IsMouseDown(ImGuiMouseButton_Left);
  const bool holds = play.grabbed() || play.pushed() || knife_ || target_ || held_solid_;
  holdOn(ray, left, play);
  mouse_.frame(layout, holds, over_view, camera_);
}

// Obeys the button that went down on the body. \return false: nothing, it is beside the body
bool ViewInput::takeHold(const Eigen::Vector3f& ray, Play& play) {
  if (play.hand == HandTool::cut) {
    knife_ = {ray, ray};
    return true;
  }
  if (play.hand == HandTool::target) return takeTarget(ray, play);
  if (play.hand == HandTool::pull && play.regrab(camera_.eye() * play.diagonal(), ray)) {
    grab_hit_ = play.grabbed()->start / play.diagonal();
    return true;
  }
  const auto hit = hitTriangles(std::span(play.shape().positions).first(play.shape().body_vertices), play.triangles(),
                                camera_.eye() * play.diagonal(), ray);
  if (!hit) return false;
  grab_hit_ = hit->point / play.diagonal();
  if (play.hand == HandTool::push) {
    // It begins in front of the surface; the wheel moves it on.
    grab_hit_ += kBallRadius * camera_.back();
    pushed_in_ = 0;
    play.push(grab_hit_ * play.diagonal(), kBallRadius * play.diagonal());
  } else {
    play.grab(hit->vertex);
  }
  return true;
}

std::vector<Handle> ViewInput::handles(const Play& play) const {
  const PlacedSolids& placed = play.placed();
  if (!placed.selected) return {};
  return handlesOf(placed[*placed.selected], camera_.right(), kSolidDiagonals * play.diagonal());
}

bool ViewInput::takeSolid(const ViewLayout& layout, const Play& play) {
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  float nearest = layout.handleReach();
  for (const Handle& handle : handles(play)) {
    const Eigen::Vector3f place = handle.place.cast<float>();
    const float off = (onScreen(layout, camera_, place / play.diagonal()) - Eigen::Vector2f(mouse.x, mouse.y)).norm();
    if (!(off < nearest)) continue;
    nearest = off;
    const std::size_t number = *play.placed().selected;
    held_solid_ = {number, play.placed()[number], handle.kind, place};
  }
  return held_solid_.has_value();
}

bool ViewInput::takeTarget(const Eigen::Vector3f& ray, const Play& play) {
  float nearest = kTargetReach;
  for (std::size_t t = 0; t < play.targets().size(); ++t) {
    const Eigen::Vector3f at = play.targets()[t].at() / play.diagonal();
    const Eigen::Vector3f way = at - camera_.eye();
    const float off = (way - way.dot(ray.normalized()) * ray.normalized()).norm() / camera_.distance;
    if (!(off < nearest)) continue;
    nearest = off;
    target_ = t;
    target_move_ = play.targets()[t].move;
    grab_hit_ = at;
  }
  return target_.has_value();
}

void ViewInput::holdOn(const Eigen::Vector3f& ray, bool left, Play& play) {
  if (!left) {
    play.release();
    play.endPush();
    target_.reset();
    held_solid_.reset();
    if (knife_) {
      const std::array<Eigen::Vector3f, 2> line = *std::exchange(knife_, std::nullopt);
      const Eigen::Vector3f normal = line[0].cross(line[1]);
      if (normal.norm() > kShortestCut) play.cut(camera_.eye() * play.diagonal(), normal.normalized());
    }
    return;
  }
  if (knife_) (*knife_)[1] = ray;
  if (held_solid_ && held_solid_->number < play.placed().size() && isMoving()) {
    const Eigen::Vector3f from = held_solid_->from / play.diagonal();
    const Eigen::Vector3f to = (from + dragOffset(camera_, from, ray)) * play.diagonal();
    const HandleKind kind = held_solid_->kind;
    play.changeSolid(held_solid_->number, dragged(held_solid_->solid, kind, to),
                     kind == HandleKind::center || isTurn(kind));
  }
  if (target_ && *target_ < play.targets().size()) {
    // The wheel turns it about the line of sight.
    const float turn = ImGui::GetIO().WantCaptureMouse ? 0 : ImGui::GetIO().MouseWheel * kTurnNotch;
    const Eigen::Matrix3f turned =
        Eigen::AngleAxisf(turn, camera_.back()).toRotationMatrix() * play.targets()[*target_].turn;
    play.moveTarget(*target_, target_move_ + dragOffset(camera_, grab_hit_, ray) * play.diagonal(), turned);
  }
  if (play.grabbed()) play.moveGrab(play.grabbed()->start + dragOffset(camera_, grab_hit_, ray) * play.diagonal());
  if (play.pushed()) {
    if (!ImGui::GetIO().WantCaptureMouse) pushed_in_ += ImGui::GetIO().MouseWheel * kBallNotch;
    const Eigen::Vector3f at = grab_hit_ + dragOffset(camera_, grab_hit_, ray) - pushed_in_ * camera_.back();
    play.movePush(at * play.diagonal());
  }
}

}  // namespace sinew::tools
