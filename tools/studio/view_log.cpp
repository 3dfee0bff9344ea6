// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_log.h"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "tools/core/error.h"

namespace sinew::tools {
ViewLog::ViewLog(const std::string& name) : file_(name.empty() ? nullptr : std::fopen(name.c_str(), "w")) {
  if (!name.empty() && file_ == nullptr)
    throw ToolError(ExitCode::system, name, "cannot be written", "Check the folder.");
}
ViewLog::~ViewLog() {
  if (file_ != nullptr) std::fclose(file_);
}

void ViewLog::say(std::uint32_t frame, const std::string& message) {
  if (file_ == nullptr || message == said_) return;
  said_ = message;
  std::fprintf(file_, "{\"frame\":%u,\"message\":%s}\n", frame, nlohmann::json(message).dump().c_str());
  std::fflush(file_);
}

void ViewLog::write(std::uint32_t frame, const ViewLayout& layout, const Camera& camera, const Play& play,
                    const Shown& shown, std::uint32_t bakes) {
  if (file_ == nullptr) return;
  Eigen::Vector3f center = Eigen::Vector3f::Zero();
  for (const Eigen::Vector3f& p : play.shape().physical) center += p / static_cast<float>(play.shape().physical.size());
  const Eigen::Vector2f center_at = onScreen(layout, camera, center / play.diagonal());
  std::fprintf(
      file_,
      "{\"frame\":%u,\"time\":%.4f,\"steps\":%u,\"scene\":\"%s\",\"playing\":%s,\"physical\":%s,\"clusters\":%s,",
      frame, play.scene().time(), play.steps(), play.scene().options().scene.name().c_str(),
      play.playing ? "true" : "false", shown.physical ? "true" : "false", shown.clusters ? "true" : "false");
  std::size_t held_channels = 0;
  double inputs = 0;
  for (std::uint32_t c = 0; c < play.scene().channelInputs().size(); ++c) {
    held_channels += play.scene().isHeld(c) ? 1U : 0U;
    inputs += static_cast<double>(play.scene().channelInputs()[c]);
  }
  std::fprintf(file_, "\"bakes\":%u,\"bodies\":%zu,\"moments\":%zu,\"moment\":%zu,\"locked\":%zu,", bakes,
               play.scene().bodies().size(), play.timeline().size(), play.timeline().at(), lockedPicks(play).size());
  std::fprintf(file_, "\"held_channels\":%zu,\"inputs\":%.4f,", held_channels, inputs);
  std::fprintf(file_, "\"diagonal\":%.6g,\"camera\":{\"yaw\":%.5f,\"pitch\":%.5f,\"distance\":%.5f},",
               static_cast<double>(play.diagonal()), static_cast<double>(camera.yaw), static_cast<double>(camera.pitch),
               static_cast<double>(camera.distance));
  std::fprintf(file_, "\"center\":[%.6g,%.6g,%.6g],\"center_at\":[%.1f,%.1f],", static_cast<double>(center.x()),
               static_cast<double>(center.y()), static_cast<double>(center.z()), static_cast<double>(center_at.x()),
               static_cast<double>(center_at.y()));
  if (const auto& grabbed = play.grabbed()) {
    const Eigen::Vector2f vertex_at =
        onScreen(layout, camera, play.shape().positions[grabbed->vertex] / play.diagonal());
    const Eigen::Vector2f target_at = onScreen(layout, camera, grabbed->target / play.diagonal());
    std::fprintf(file_, "\"grabbed\":%u,\"vertex_at\":[%.1f,%.1f],\"target_at\":[%.1f,%.1f]}\n", grabbed->vertex,
                 static_cast<double>(vertex_at.x()), static_cast<double>(vertex_at.y()),
                 static_cast<double>(target_at.x()), static_cast<double>(target_at.y()));
  } else {
    std::fprintf(file_, "\"grabbed\":null}\n");
  }
  std::fflush(file_);
}

}  // namespace sinew::tools
