// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/section_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

namespace sinew::tools {

std::vector<std::array<std::uint32_t, 3>> sectionFaces(const formats::PackageView& package, const Section& section) {
  const auto physical = package.physicalVertices();
  const auto axis = std::size_t(section.axis);
  float low = 0, high = 0;
  for (std::size_t v = 0; v < physical.size(); ++v) {
    const float x = physical[v].rest_position[axis];
    low = v == 0 ? x : std::min(low, x);
    high = v == 0 ? x : std::max(high, x);
  }
  const float plane = low + section.at * (high - low);
  std::map<std::array<std::uint32_t, 3>, std::array<std::uint32_t, 3>> open;  // sorted corners: as they turn
  for (const auto& [t] : package.tetrahedra()) {
    float middle = 0;
    for (const std::uint32_t v : t) middle += physical[v].rest_position[axis] / 4;
    if ((middle < plane) == section.flip) continue;
    for (const std::array<std::uint32_t, 3>& face :
         {std::array{t[0], t[2], t[1]}, {t[0], t[1], t[3]}, {t[0], t[3], t[2]}, {t[1], t[2], t[3]}}) {
      std::array<std::uint32_t, 3> key = face;
      std::sort(key.begin(), key.end());
      const auto [found, is_new] = open.emplace(key, face);
      if (!is_new) open.erase(found);
    }
  }
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const auto& [key, face] : open) faces.push_back(face);
  return faces;
}

void SectionView::make(const Section& section, const std::shared_ptr<const Asset>& asset) {
  made_ = section;
  asset_ = asset;
  const formats::PackageView& package = asset->package();
  faces_ = sectionFaces(package, section);
  DrawModel model;
  model.diagonal = package.info().diagonal;
  for (const auto& face : faces_) {
    const auto first = std::uint32_t(model.positions.size());
    for (const std::uint32_t v : face) {
      const auto& x = package.physicalVertices()[v].rest_position;
      model.positions.emplace_back(x[0], x[1], x[2]);
    }
    model.triangles.push_back({first, first + 1, first + 2});
  }
  model.normals.assign(model.positions.size(), Eigen::Vector3f::UnitY());
  DrawPart& part = model.parts.emplace_back();
  part.triangle_count = std::uint32_t(model.triangles.size());
  part.base_color = {0.62F, 0.36F, 0.26F};
  renderer_.reset();
  if (!faces_.empty()) renderer_.emplace(model);
}

Renderer* SectionView::draw(const Section& section, const Play& play, const Camera& camera,
                            const DrawSettings& settings, int width, int height) {
  const std::shared_ptr<const Asset>& asset = play.shape().assets.front();
  if (made_ != section || asset_ != asset) make(section, asset);
  if (!renderer_) return nullptr;
  std::vector<Eigen::Vector3f> positions, normals;
  for (const auto& face : faces_) {
    const auto& x = play.shape().physical;
    const Eigen::Vector3f normal = (x[face[1]] - x[face[0]]).cross(x[face[2]] - x[face[0]]).normalized();
    for (const std::uint32_t v : face) {
      positions.push_back(x[v]);
      normals.push_back(normal);
    }
  }
  renderer_->setShape(positions, normals);
  DrawSettings own = settings;
  own.physical = own.clusters = own.pinned = false;
  own.tint = 0;
  renderer_->draw(camera, own, width, height);
  return &*renderer_;
}

}  // namespace sinew::tools
