// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/error_page.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>

#include "tools/render/camera.h"
#include "tools/study/row_picture.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3f;

constexpr std::array<double, 6> kBudgets = {0.05, 0.1, 0.2, 0.5, 1, 2};  // ms a frame
constexpr double kPictureMilliseconds = 1;
// Of the reference's largest displacement: the last colour.
constexpr float kWorstColor = 0.5F;
// Told apart by colour-blind eyes (Okabe and Ito 2008), and by their shapes.
constexpr std::array<const char*, kMethodCount> kColors = {"#d55e00", "#cc79a7", "#0072b2", "#009e73",
                                                           "#e69f00", "#56b4e9", "#666666"};
constexpr std::array<const char*, kMethodCount> kTold = {
    "Sinew",
    "the report's averaged clusters",
    "XPBD on tetrahedra (Macklin and Müller 2021), small steps",
    "finite elements with stiffness warping, implicit Euler, conjugate gradients",
    "Bullet's deformable finite elements, as by default",
    "Bullet's deformable finite elements, implicit",
    "Bullet's soft body of links, default configuration: they have no modulus, and how stiff they are depends on mesh "
    "and iterations"};

template <class... Values>
std::string text(const char* format, Values... values) {
  std::array<char, 1024> line{};
  std::snprintf(line.data(), line.size(), format, values...);
  return line.data();
}

std::string escaped(std::string_view plain) {
  std::string result;
  for (const char c : plain) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (i + k < bytes.size() ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) {
      result += i + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
  }
  return result;
}

std::string percent(double share) { return text(share < 0.1 ? "%.1f %%" : "%.0f %%", 100 * share); }

// From white over yellow to dark red, each darker than the one before. Linear RGB.
std::array<float, 3> errorColor(float share) {
  constexpr std::array<std::array<float, 3>, 5> kStops = {
      {{0.8F, 0.8F, 0.8F}, {0.95F, 0.75F, 0.15F}, {0.9F, 0.3F, 0.03F}, {0.45F, 0.02F, 0.04F}, {0.1F, 0.0F, 0.06F}}};
  const float at = std::clamp(share / kWorstColor, 0.0F, 1.0F) * float(kStops.size() - 1);
  const auto low = std::min(std::size_t(at), kStops.size() - 2);
  const float t = at - float(low);
  std::array<float, 3> color{};
  for (std::size_t k = 0; k < 3; ++k) color[k] = (1 - t) * kStops[low][k] + t * kStops[low + 1][k];
  return color;
}

// A mark of a method: a shape of its own, so that it is known without its colour.
std::string mark(Method method, double x, double y, const std::string& title) {
  const char* color = kColors[std::size_t(method)];
  const std::string inside = title.empty() ? "" : "<title>" + escaped(title) + "</title>";
  constexpr double r = 5;
  switch (std::size_t(method) % 4) {
    case 0:
      return text("<circle cx='%.1f' cy='%.1f' r='%.1f' fill='%s'>", x, y, r, color) + inside + "</circle>";
    case 1:
      return text("<rect x='%.1f' y='%.1f' width='%.1f' height='%.1f' fill='%s'>", x - r, y - r, 2 * r, 2 * r, color) +
             inside + "</rect>";
    case 2:
      return text("<path d='M%.1f %.1fl%.1f %.1fh%.1fz' fill='%s'>", x, y - r, r, 2 * r, -2 * r, color) + inside +
             "</path>";
    default:
      return text("<path d='M%.1f %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz' fill='%s'>", x, y - r, r, r, -r, r, -r, -r,
                  color) +
             inside + "</path>";
  }
}

// Error over time, both by their logarithms.
std::string diagram(const ErrorStudy& study, std::uint32_t s) {
  constexpr double kWidth = 760, kHeight = 420, kLeft = 62, kRight = 12, kTop = 10, kBottom = 44;
  double low_x = 0.05, high_x = 2, low_y = 0.1, high_y = 1;
  for (const ErrorRow& row : study.rows) {
    if (row.scene != s || row.lost || row.slow) continue;
    low_x = std::min(low_x, row.milliseconds), high_x = std::max(high_x, row.milliseconds);
    low_y = std::min(low_y, row.path), high_y = std::max(high_y, row.path);
  }
  low_x *= 0.8, high_x *= 1.25, low_y *= 0.8;
  high_y = std::min(1.25 * high_y, 4.0);
  const auto x = [&](double ms) {
    return kLeft + (kWidth - kLeft - kRight) * std::log(ms / low_x) / std::log(high_x / low_x);
  };
  const auto y = [&](double error) {
    return kTop +
           (kHeight - kTop - kBottom) * std::log(high_y / std::clamp(error, low_y, high_y)) / std::log(high_y / low_y);
  };
  std::string svg = text("<svg viewBox='0 0 %.0f %.0f' role='img' aria-label='Error over time'>", kWidth, kHeight);
  for (double decade = 1e-4; decade < 1e3; decade *= 10) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double value = decade * digit;
      if (value > low_x && value < high_x) {
        svg += text(
            "<line class='g' x1='%.1f' x2='%.1f' y1='%.1f' y2='%.1f'/><text x='%.1f' y='%.1f' "
            "text-anchor='middle'>%g</text>",
            x(value), x(value), kTop, kHeight - kBottom, x(value), kHeight - kBottom + 16, value);
      }
      if (value > low_y && value < high_y) {
        svg += text(
            "<line class='g' x1='%.1f' x2='%.1f' y1='%.1f' y2='%.1f'/><text x='%.1f' y='%.1f' text-anchor='end'>%g "
            "%%</text>",
            kLeft, kWidth - kRight, y(value), y(value), kLeft - 5, y(value) + 4, 100 * value);
      }
    }
  }
  svg += text("<text x='%.1f' y='%.1f' text-anchor='middle'>processor time of a frame of 1/60 s, ms</text>",
              0.5 * (kLeft + kWidth), kHeight - 6);
  for (std::size_t m = 0; m < kMethodCount; ++m) {
    std::vector<const ErrorRow*> front;
    for (const ErrorRow& row : study.rows) {
      if (row.scene == s && row.method == Method(m) && row.own_front) front.push_back(&row);
    }
    std::sort(front.begin(), front.end(),
              [](const ErrorRow* one, const ErrorRow* other) { return one->milliseconds < other->milliseconds; });
    std::string points;
    for (const ErrorRow* row : front) points += text("%.1f,%.1f ", x(row->milliseconds), y(row->path));
    if (front.size() > 1) svg += text("<polyline points='%s' fill='none' stroke='%s'/>", points.c_str(), kColors[m]);
  }
  for (const ErrorRow& row : study.rows) {
    if (row.scene != s || row.lost || row.slow) continue;
    const std::string title =
        std::string(nameOf(row.method)) + ": " + row.knobs + text("; %.3f ms, ", row.milliseconds) + percent(row.path);
    svg += text("<g opacity='%s'>", row.own_front ? "1" : "0.35") +
           mark(row.method, x(row.milliseconds), y(row.path), title) + "</g>";
  }
  return svg + "</svg>";
}

std::string legend(std::span<const ErrorStudy> studies) {
  std::string html = "<p class='legend'>";
  for (std::size_t m = 0; m < kMethodCount; ++m) {
    if (std::none_of(studies.begin(), studies.end(), [&](const ErrorStudy& study) {
          return std::any_of(study.rows.begin(), study.rows.end(),
                             [&](const ErrorRow& row) { return row.method == Method(m); });
        }))
      continue;
    html += "<span><svg class='key' viewBox='0 0 14 14'>" + mark(Method(m), 7, 7, "") + "</svg> <b>" +
            escaped(nameOf(Method(m))) + "</b>: " + kTold[m] + "</span> ";
  }
  return html + "</p>";
}

std::string table(const ErrorStudy& study, std::uint32_t s) {
  std::vector<const ErrorRow*> rows;
  for (const ErrorRow& row : study.rows) {
    if (row.scene == s) rows.push_back(&row);
  }
  const bool swings = study.scenes[s].frequency.has_value(), strays = study.scenes[s].turned.has_value();
  std::string html =
      "<details><summary>All rows</summary><table><tr><th>method<th>set to<th>ms a frame<th>error of the path<th>of "
      "the "
      "end<th>largest<th>volume";
  if (swings) html += "<th>frequency<th>decay";
  if (strays) html += "<th>path as it lies<th>turned";
  html += "</tr>";
  for (const ErrorRow* row : rows) {
    html += text("<tr%s><td>", row->front ? " class='f'" : "") + escaped(nameOf(row->method)) + "<td>" +
            escaped(row->knobs) + text("<td>%.3f", row->milliseconds);
    if (row->slow || row->lost) {
      html += text("<td colspan='%d'>%s</tr>",
                   swings   ? 6
                   : strays ? 5
                            : 4,
                   row->slow ? "too slow: stopped" : "lost: not finite, or far away");
      continue;
    }
    html += "<td>" + percent(row->path) + "<td>" + percent(row->end) + "<td>" + percent(row->largest) + "<td>" +
            percent(row->volume);
    if (swings && row->frequency) html += text("<td>%.3f ×<td>%.2f ×", *row->frequency, *row->decay);
    if (swings && !row->frequency) html += "<td>none<td>";
    if (row->astray) html += "<td>" + percent(*row->astray) + text("<td>%.0f°", *row->turned);
    html += "</tr>";
  }
  return html + "</table></details>";
}

std::string picture(const ErrorStudy& study, std::uint32_t s) {
  const ErrorScene& scene = study.scenes[s];
  const formats::PackageView& package = study.asset->package();
  const auto shapeOf = [&](const std::vector<Vector3f>& positions) {
    Shape shape;
    shape.positions = positions;
    shape.normals.assign(positions.size(), Vector3f::Zero());
    for (const auto& c : package.visualTriangles()) {
      const Vector3f n = (positions[c[1]] - positions[c[0]]).cross(positions[c[2]] - positions[c[0]]);
      for (const std::uint32_t v : c) shape.normals[v] += n;
    }
    for (Vector3f& n : shape.normals) n.normalize();
    return shape;
  };
  const std::array<float, 3> plain = errorColor(0);
  std::vector<RowPicture> row = {
      {study.asset, shapeOf(scene.shape), "reference", std::vector<std::array<float, 3>>(scene.shape.size(), plain)}};
  for (std::size_t m = 0; m < kMethodCount; ++m) {
    const ErrorRow* best = bestWithin(study, s, Method(m), kPictureMilliseconds);
    if (best == nullptr) continue;
    std::vector<std::array<float, 3>> colors;
    const auto largest = float(scene.largest * study.diagonal);
    for (std::size_t v = 0; v < scene.shape.size(); ++v) {
      colors.push_back(errorColor((best->shape[v] - scene.shape[v]).norm() / largest));
    }
    row.push_back({study.asset, shapeOf(best->shape),
                   std::string(nameOf(best->method)) + text(", %.2f ms: ", best->milliseconds) + percent(best->path),
                   std::move(colors)});
  }
  RowOptions options;
  options.width = 300;
  options.height = 260;
  options.columns = 4;
  const Image image = drawRow(row, viewCamera(ViewName::three_quarter), options);
  return "<img alt='The reference, and the best of each method within " + text("%g", kPictureMilliseconds) +
         " ms' src='data:image/png;base64," + base64(encodedPng(image)) + "'>";
}

// The best within each time: of this runtime, then of all others; the nearer one bold.
std::string budgets(std::span<const ErrorStudy> studies) {
  std::string html = "<table class='budgets'><tr><th>within, ms a frame";
  for (const double budget : kBudgets) html += text("<th>%g", budget);
  html += "</tr>";
  for (const ErrorStudy& study : studies) {
    for (std::uint32_t s = 0; s < study.scenes.size(); ++s) {
      html += "<tr><td>" + escaped(study.input + ": " + study.scenes[s].name);
      for (const double budget : kBudgets) {
        const ErrorRow* own = bestWithin(study, s, Method::sinew, budget);
        const ErrorRow* other = bestOfOthers(study, s, budget);
        const auto said = [](const ErrorRow* row, const ErrorRow* rival) {
          if (row == nullptr) return std::string("–");
          const bool nearer = rival == nullptr || row->path <= rival->path;
          return nearer ? "<b>" + percent(row->path) + "</b>" : percent(row->path);
        };
        html += "<td>" + said(own, other) + "; " + said(other, own);
        if (other != nullptr) html += " <small>" + escaped(nameOf(other->method)) + "</small>";
      }
      html += "</tr>";
    }
  }
  return html + "</table>";
}

// Where one overtakes the other, in words.
std::string crossovers(const ErrorStudy& study, std::uint32_t s) {
  std::set<double> times;
  for (const ErrorRow& row : study.rows) {
    if (row.scene == s && row.own_front) times.insert(row.milliseconds);
  }
  std::string html;
  const ErrorRow* before = nullptr;
  for (const double time : times) {
    const ErrorRow* best = bestWithin(study, s, {}, time);
    if (best == nullptr || (before != nullptr && best->method == before->method)) {
      if (best != nullptr) before = best;
      continue;
    }
    html += (before == nullptr ? "From " : "; from ") + text("%.3g ms a frame on ", time) + "<b>" +
            escaped(nameOf(best->method)) + "</b> is nearest (" + percent(best->path) + ", " + escaped(best->knobs) +
            ")";
    before = best;
  }
  if (before != nullptr && bestWithin(study, s, {}, 1e9) != before) before = bestWithin(study, s, {}, 1e9);
  if (before != nullptr) html += "; nothing that was tried comes nearer than " + percent(before->path);
  return "<p>" + html + ".</p>";
}

std::string section(const ErrorStudy& study, std::uint32_t s) {
  const ErrorScene& scene = study.scenes[s];
  std::string html =
      "<h3>" + escaped(scene.name) + "</h3>" + crossovers(study, s) + diagram(study, s) +
      "<p><small>Lines join what nothing of the same method beats; marks on the upper edge are further away. "
      "Settings: under a mark.</small></p>";
  html +=
      "<p>At the reference's largest displacement, the best of each method within " +
      text(
          "%g ms; colour is the distance from the reference, white none, dark %g %% of its largest displacement and "
          "more.</p>",
          kPictureMilliseconds, 100 * double(kWorstColor)) +
      picture(study, s) + table(study, s);
  html += text(
      "<p><small>Reference: %u tetrahedra, steps of %.2g ms, %.0f s; its surface moved by %.2f %% of the diagonal "
      "rms, %.1f %% at most. ",
      scene.tetrahedra, 1e3 * scene.step_seconds, scene.reference_seconds, 100 * scene.rms, 100 * scene.largest);
  html += !scene.self.empty() ? "<b>It is Sinew itself, of " + escaped(scene.self) +
                                    " a frame: finite elements would take too long. These figures say what fewer "
                                    "functions and longer steps cost, not what all functions lack.</b> "
          : scene.linear ? "Its elements are quadratic; linear ones on the same tetrahedra are " +
                               percent(*scene.linear) + " off. "
                         : std::string(
                               "<b>Its elements are linear: quadratic ones would take too long. They are too stiff, by "
                               "how much these figures do not say.</b> ");
  if (scene.refined) html += text("Each tetrahedron cut into eight changed them by %.2g %%. ", 100 * *scene.refined);
  if (scene.self.empty()) {
    html += text(
        "Steps of half the length change linear ones by %.2g %%, the stable neo-Hookean law by %.1f %%, "
        "Sinew's own law by %.1f %%. ",
        100 * scene.shorter, 100 * scene.neo_hookean, 100 * scene.own_law);
  }
  html += text("Gravity %.3g m/s².</small></p>", scene.gravity);
  if (scene.penalty) {
    html += "<p><small>A ground twice as firm changes linear elements by " + percent(*scene.penalty) + ".</small></p>";
  }
  if (scene.lawMatters()) {
    html += "<p><b>Strains are so large here that the law of elasticity matters: compare with care.</b></p>";
  }
  return html;
}

}  // namespace

std::string errorPage(std::span<const ErrorStudy> studies) {
  std::string names;
  for (const ErrorStudy& study : studies) names += (names.empty() ? "" : ", ") + study.input;
  std::string html =
      "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
      "<title>Error against run time: " +
      escaped(names) +
      "</title><style>body{font:15px/1.5 system-ui,sans-serif;max-width:1240px;margin:1.5em auto;padding:0 "
      "1em;color:#222;"
      "background:#fff}table{border-collapse:collapse;margin:.6em 0}th,td{padding:.15em "
      ".7em;text-align:left;vertical-align:"
      "top;border-bottom:1px solid #ddd}svg{max-width:860px;width:100%;font:12px "
      "system-ui,sans-serif}svg.key{width:14px;"
      "height:14px;vertical-align:middle}.g{stroke:#e4e4e4}.r{stroke:#888;stroke-dasharray:4 4}.f "
      "td{font-weight:600}img{"
      "max-width:100%}.legend span{display:block}small{color:#555}summary{cursor:pointer}</style>";
  html += "<h1>Error against run time</h1>";
  html +=
      "<h2>What a time buys</h2><p>The least error of the path within a processor time of a frame, one thread, of any "
      "setting tried: Sinew's; the best other's. Bold: the nearer one; –: no setting is so fast. 100 % is a body that "
      "does not move.</p>" +
      budgets(studies) + legend(studies);
  for (const ErrorStudy& study : studies) {
    html += "<h2>" + escaped(study.input) + "</h2>";
    html += text(
        "<p>%u physical vertices, %u tetrahedra, %u visual vertices, %.3g m across; Young's modulus %.3g Pa, Poisson's "
        "ratio %.2g.</p>",
        study.vertices, study.tetrahedra, std::uint32_t(study.asset->package().visualPositions().size()),
        study.diagonal, study.material.young, study.material.poisson);
    for (std::uint32_t s = 0; s < study.scenes.size(); ++s) html += section(study, s);
    for (const std::string& note : study.notes) html += "<p>" + escaped(note) + "</p>";
  }
  html +=
      "<h2>How it was measured</h2><p>All methods have the same material, masses, damping, holds and frames of 1/60 s; "
      "a recipe's bounds on stretch (clusters.limit) are left out. "
      "The "
      "reference is corotated linear elasticity on the recipe's own tetrahedra, of ten nodes, by "
      "central "
      "differences. Errors are distances of visual vertices, weighed by area, as a share of the reference's own rms "
      "displacement: over all vertices and frames (path), of the mean shape of the last quarter of a second (end), the "
      "largest "
      "one as "
      "a share of the largest displacement, and the volume's as a share of that at rest. Meshes of fewer vertices are "
      "baked "
      "from the same source; their own surface differs from the reference's, and that is part of their error. "
      "hang: the top tenth is held, gravity sets in; release: held by its rear quarter, gravity ends after 1 s, "
      "what follows is compared; press: the top tenth moves down by 20 % of the height in 1 s; squeeze: by 5 %; "
      "twist: one end turns by 60 degrees; lean: the lowest tenth is held, gravity sideways; pins: the recipe's "
      "own pins hold it; feet: it falls on level ground (friction 0.6) from a tenth of its height, under a gravity "
      "that moves it by as much where it is held by its lowest tenth. There displacements are what is left of each "
      "frame without its best rigid motion, from the reference's first contact on: what only moves rigidly has 100 "
      "%, wherever it lies; the column path as it lies has the rigid motion too. Times are the processor's, of one "
      "thread.</p>";
  return html + "</html>\n";
}

}  // namespace sinew::tools
