// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/defect_picture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "tools/render/camera.h"
#include "tools/render/draw_model.h"
#include "tools/render/headless.h"
#include "tools/render/image.h"
#include "tools/render/overlay.h"
#include "tools/render/page.h"
#include "tools/render/renderer.h"
#include "tools/render/text.h"

namespace sinew::tools {

namespace {

constexpr int kMargin = 20;
constexpr int kGap = 6;
constexpr int kTileWidth = 400;
constexpr int kTileHeight = 340;
constexpr int kColumns = 4;
constexpr std::size_t kCloseUps = 4;
constexpr float kFitMargin = 0.10F;
// Told apart on grey clay and for most colour-blind eyes (after Okabe and Ito 2008), repeated beyond eight.
constexpr std::array<Rgb8, 8> kColors = {{{213, 40, 24},
                                          {0, 114, 178},
                                          {240, 180, 0},
                                          {0, 158, 115},
                                          {204, 80, 200},
                                          {86, 180, 233},
                                          {230, 120, 0},
                                          {90, 70, 160}}};

Rgba8 opaque(Rgb8 c) { return {c[0], c[1], c[2], 255}; }

std::string_view severityName(Severity severity) {
  switch (severity) {
    case Severity::error:
      return "error";
    case Severity::warning:
      return "warning";
    case Severity::info:
      return "info";
  }
  return "";
}

// The places of one finding on the drawn mesh.
struct Mark {
  const Finding* finding = nullptr;
  Rgb8 color{};
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> vertices;              // visual
  std::vector<std::array<std::uint32_t, 2>> edges;  // visual
  std::vector<std::uint32_t> first_place;           // visual vertices of the first place, for the close-up
};

std::vector<Mark> locate(const VisualMesh& mesh, const std::vector<const Finding*>& findings) {
  // Welded edges that one face, or more than two, use: with one pair of visual vertices to draw them by.
  using Edge = std::array<std::uint32_t, 2>;
  struct Use {
    int faces = 0;
    Edge visual{};
  };
  std::map<Edge, Use> uses;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = mesh.triangles[t][k];
      const std::uint32_t b = mesh.triangles[t][(k + 1) % 3];
      if (mesh.welded[a] == mesh.welded[b]) continue;
      Use& use = uses[{std::min(mesh.welded[a], mesh.welded[b]), std::max(mesh.welded[a], mesh.welded[b])}];
      ++use.faces;
      use.visual = {a, b};
    }
  }
  std::vector<Mark> marks;
  for (const Finding* finding : findings) {
    Mark mark;
    mark.finding = finding;
    mark.color = kColors[marks.size() % kColors.size()];
    std::map<std::uint32_t, std::size_t> order;  // place -> its rank in the finding
    for (std::size_t i = 0; i < finding->places.size(); ++i) order.try_emplace(finding->places[i], i);
    std::size_t best = finding->places.size();
    if (finding->place_kind == "face") {
      for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        const auto at = order.find(mesh.triangle_face[t]);
        if (at == order.end()) continue;
        mark.triangles.push_back(t);
        if (at->second < best) {
          best = at->second;
          mark.first_place.assign(mesh.triangles[t].begin(), mesh.triangles[t].end());
        }
      }
    } else if (finding->place_kind == "vertex") {
      std::set<std::uint32_t> welded;
      for (std::uint32_t v = 0; v < mesh.source_vertex.size(); ++v) {
        const auto at = order.find(mesh.source_vertex[v]);
        if (at == order.end()) continue;
        mark.vertices.push_back(v);
        welded.insert(mesh.welded[v]);
        if (at->second < best) {
          best = at->second;
          mark.first_place = {v};
        }
      }
      for (const auto& [edge, use] : uses) {
        if (use.faces != 2 && welded.contains(edge[0]) && welded.contains(edge[1])) mark.edges.push_back(use.visual);
      }
    }
    marks.push_back(std::move(mark));
  }
  return marks;
}

}  // namespace

void renderDefects(const VisualMesh& mesh, const std::vector<Finding>& findings, const std::filesystem::path& png) {
  std::vector<const Finding*> ordered;
  for (const Finding& f : findings) ordered.push_back(&f);
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const Finding* a, const Finding* b) { return a->severity > b->severity; });
  const std::vector<Mark> marks = locate(mesh, ordered);

  const DrawModel model = makeDrawModel(mesh);
  const HeadlessContext context;
  Renderer renderer(model);
  // Marks the places of one finding, or of all warnings and errors, the gravest on top. Information (parts counted,
  // settings chosen) stays in the legend: marks of it would bury the defects.
  const auto show = [&](const Mark* only) {
    std::vector<Renderer::Highlight> highlights;
    Annotation annotation;
    annotation.points = model.positions;
    annotation.line_width = only != nullptr ? 3.0F : 2.0F;
    for (auto mark = marks.rbegin(); mark != marks.rend(); ++mark) {
      if (only != nullptr ? &*mark != only : mark->finding->severity == Severity::info) continue;
      if (!mark->triangles.empty()) highlights.push_back({mark->triangles, opaque(mark->color)});
      for (const std::uint32_t t : mark->triangles) {
        const auto& v = model.triangles[t];
        for (std::size_t k = 0; k < 3; ++k) annotation.lines.push_back({v[k], v[(k + 1) % 3], opaque(mark->color)});
        // Too small to see as a face: a dot as well.
        const Eigen::Vector3f center = (model.positions[v[0]] + model.positions[v[1]] + model.positions[v[2]]) / 3;
        const float area = (model.positions[v[1]] - model.positions[v[0]])
                               .cross(model.positions[v[2]] - model.positions[v[0]])
                               .norm() /
                           2;
        if (std::sqrt(area) > 0.02F * model.diagonal) continue;
        annotation.dots.push_back({static_cast<std::uint32_t>(annotation.points.size()), opaque(mark->color)});
        annotation.points.push_back(center);
      }
      for (const auto& e : mark->edges) annotation.lines.push_back({e[0], e[1], opaque(mark->color)});
      for (const std::uint32_t v : mark->vertices) annotation.dots.push_back({v, opaque(mark->color)});
    }
    renderer.setHighlights(highlights);
    renderer.setAnnotation(annotation);
  };
  show(nullptr);

  std::vector<Eigen::Vector3f> drawn;
  for (const Eigen::Vector3f& p : model.positions) drawn.push_back(p / model.diagonal);
  MotionHull hull;
  hull.add(drawn);
  DrawSettings settings;
  settings.shadow_center = hull.center();
  settings.shadow_radius = std::max(hull.radius(), 1e-3F);

  const float aspect = static_cast<float>(kTileWidth) / static_cast<float>(kTileHeight);
  std::vector<std::pair<Image, Rgb8>> tiles;
  struct View {
    const char* name;
    float yaw, pitch;
  };
  constexpr std::array<View, kColumns> kViews = {
      {{"front right", 0.7F, 0.3F}, {"front left", -0.9F, 0.3F}, {"back", 3.6F, 0.3F}, {"below", 0.7F, -0.9F}}};
  for (const View& view : kViews) {
    Camera camera;
    camera.yaw = view.yaw;
    camera.pitch = view.pitch;
    fitCamera(camera, hull.points(), aspect, kFitMargin);
    settings.lighting = turnedLighting(Lighting{}, camera.yaw - kLitYaw);
    renderer.draw(camera, settings, kTileWidth, kTileHeight);
    tiles.emplace_back(renderer.read(), kInk);
    drawCaption(tiles.back().first, 8, 6, 17, view.name);
  }
  std::size_t close_ups = 0;
  for (const Mark& mark : marks) {
    if (mark.first_place.empty() || mark.finding->severity == Severity::info || close_ups == kCloseUps) continue;
    ++close_ups;
    // Looks at the place along the surface normal there, from a few times the size of the faces around it.
    std::set<std::uint32_t> place;
    for (const std::uint32_t v : mark.first_place) place.insert(mesh.welded[v]);
    Eigen::Vector3f low = drawn[mark.first_place[0]];
    Eigen::Vector3f high = low;
    for (const std::uint32_t v : mark.first_place) {
      low = low.cwiseMin(drawn[v]);
      high = high.cwiseMax(drawn[v]);
    }
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float around = (high - low).norm();
    for (const Triangle& t : mesh.triangles) {
      if (!place.contains(mesh.welded[t[0]]) && !place.contains(mesh.welded[t[1]]) &&
          !place.contains(mesh.welded[t[2]]))
        continue;
      normal += (drawn[t[1]] - drawn[t[0]]).cross(drawn[t[2]] - drawn[t[0]]);
      for (std::size_t k = 0; k < 3; ++k) around = std::max(around, (drawn[t[k]] - drawn[t[(k + 1) % 3]]).norm());
    }
    normal = normal.norm() > 1e-12F ? Eigen::Vector3f(normal.normalized()) : Eigen::Vector3f(0.5F, 0.4F, 0.77F);
    const float size = std::clamp(1.6F * around, 0.04F, 0.6F);
    Camera camera;
    camera.yaw = std::atan2(normal.x(), normal.z()) + 0.35F;
    camera.pitch = std::clamp(std::asin(std::clamp(normal.y(), -1.0F, 1.0F)) + 0.2F, -1.4F, 1.4F);
    camera.target = (low + high) / 2;
    camera.distance = size / std::tan(camera.fov_y / 2);
    camera.near_plane = camera.distance * 0.05F;
    camera.far_plane = camera.distance + 4;
    settings.lighting = turnedLighting(Lighting{}, camera.yaw - kLitYaw);
    show(&mark);
    renderer.draw(camera, settings, kTileWidth, kTileHeight);
    tiles.emplace_back(renderer.read(), mark.color);
    Image& picture = tiles.back().first;
    picture.fillRectangle(0, 0, kTileWidth, 4, mark.color);
    std::string text = "close-up: " + mark.finding->id;
    if (!mark.finding->places.empty())
      text += ", " + mark.finding->place_kind + " " + std::to_string(mark.finding->places.front());
    drawCaption(picture, 8, 8, 17, text);
  }

  constexpr int kTitleHeight = 62;
  constexpr int kLegendLine = 46;
  const int rows = (static_cast<int>(tiles.size()) + kColumns - 1) / kColumns;
  const int legend = std::max(1, static_cast<int>(marks.size())) * kLegendLine;
  Image sheet(2 * kMargin + kColumns * kTileWidth + (kColumns - 1) * kGap,
              2 * kMargin + kTitleHeight + rows * (kTileHeight + kGap) + 10 + legend, kPaper);
  const float room = static_cast<float>(sheet.width - 2 * kMargin);
  drawText(sheet, kMargin, kMargin - 4, 30, kInk, fitText(mesh.file, 30, room));
  drawText(
      sheet, kMargin, kMargin + 29, 17, kGreyInk,
      std::to_string(mesh.source_vertex_count) + " source vertices, " + std::to_string(mesh.source_face_count) +
          " faces  ·  " +
          (findings.empty() ? std::string("no findings")
                            : std::to_string(findings.size()) + (findings.size() == 1 ? " finding" : " findings")));
  int y = kMargin + kTitleHeight;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const int column = static_cast<int>(i) % kColumns;
    if (i > 0 && column == 0) y += kTileHeight + kGap;
    sheet.paste(tiles[i].first, kMargin + column * (kTileWidth + kGap), y);
  }
  y += kTileHeight + kGap + 10;
  if (marks.empty()) drawText(sheet, kMargin, static_cast<float>(y), 18, kInk, "Nothing was found.");
  for (const Mark& mark : marks) {
    const Finding& f = *mark.finding;
    const bool shown = !mark.triangles.empty() || !mark.vertices.empty();
    if (shown) sheet.fillRectangle(kMargin, y + 2, 18, 18, mark.color);
    std::string head =
        std::string(severityName(f.severity)) + "  " + f.id + (f.count > 0 ? "  ×" + std::to_string(f.count) : "");
    if (shown && f.count > f.places.size()) head += "  (the first " + std::to_string(f.places.size()) + " shown)";
    head += "  " + f.message;
    const auto text_y = static_cast<float>(y);
    drawText(sheet, kMargin + 28, text_y, 18, kInk, fitText(head, 18, room - 28));
    drawText(sheet, kMargin + 28, text_y + 21, 16, kGreyInk, fitText(f.cure, 16, room - 28));
    y += kLegendLine;
  }
  writePng(sheet, png);
}

}  // namespace sinew::tools
