// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cstdio>

#include "tools/study/error.h"

namespace sinew::tools {

nlohmann::ordered_json errorJson(const ErrorStudy& study) {
  nlohmann::ordered_json json = {{"study", "error"},
                                 {"input", study.input},
                                 {"material", {{"young", study.material.young}, {"poisson", study.material.poisson}}},
                                 {"diagonal", study.diagonal},
                                 {"vertices", study.vertices},
                                 {"tetrahedra", study.tetrahedra},
                                 {"notes", study.notes}};
  json["scenes"] = nlohmann::ordered_json::array();
  for (std::uint32_t s = 0; s < study.scenes.size(); ++s) {
    const ErrorScene& scene = study.scenes[s];
    nlohmann::ordered_json one = {
        {"name", scene.name},
        {"gravity", scene.gravity},
        {"seconds", scene.seconds},
        {"compared_vertices", scene.compared},
        {"reference",
         {{"tetrahedra", scene.tetrahedra},
          {"step_seconds", scene.step_seconds},
          {"seconds", scene.reference_seconds},
          {"rms_displacement", scene.rms},
          {"largest_displacement", scene.largest},
          {"quadratic", scene.linear.has_value()},
          {"self", scene.self.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(scene.self)},
          {"from_linear", scene.linear ? nlohmann::ordered_json(*scene.linear) : nullptr},
          {"change_refined", scene.refined ? nlohmann::ordered_json(*scene.refined) : nullptr},
          {"change_shorter_steps", scene.shorter},
          {"change_neo_hookean", scene.neo_hookean},
          {"change_own_law", scene.own_law},
          {"turned_deg", scene.turned ? nlohmann::ordered_json(*scene.turned) : nullptr},
          {"change_firmer_ground", scene.penalty ? nlohmann::ordered_json(*scene.penalty) : nullptr},
          {"frequency_hz", scene.frequency ? nlohmann::ordered_json(*scene.frequency) : nullptr}}}};
    one["results"] = nlohmann::ordered_json::array();
    for (const ErrorRow& row : study.rows) {
      if (row.scene != s) continue;
      nlohmann::ordered_json r = {{"method", nameOf(row.method)},
                                  {"knobs", row.knobs},
                                  {"vertices", row.vertices},
                                  {"milliseconds_per_frame", row.milliseconds},
                                  {"lost", row.lost},
                                  {"slow", row.slow}};
      if (!row.lost && !row.slow) {
        r["path"] = row.path;
        r["end"] = row.end;
        r["largest"] = row.largest;
        r["volume"] = row.volume;
        if (row.frequency) r["frequency_ratio"] = *row.frequency;
        if (row.decay) r["decay_ratio"] = *row.decay;
        if (row.astray) r["astray"] = *row.astray;
        if (row.turned) r["turned_deg"] = *row.turned;
        r["front"] = row.front;
        r["own_front"] = row.own_front;
      }
      one["results"].push_back(std::move(r));
    }
    json["scenes"].push_back(std::move(one));
  }
  return json;
}

std::string errorText(const ErrorStudy& study) {
  std::array<char, 512> line{};
  std::string text;
  const auto print = [&](const char* format, auto... values) {
    std::snprintf(line.data(), line.size(), format, values...);
    text += line.data();
  };
  print("%s: %u physical vertices, %u tetrahedra, E %.3g Pa, nu %.2g\n", study.input.c_str(), study.vertices,
        study.tetrahedra, study.material.young, study.material.poisson);
  for (std::uint32_t s = 0; s < study.scenes.size(); ++s) {
    const ErrorScene& scene = study.scenes[s];
    print("\n%s: reference %u tetrahedra, %.2g ms steps, moved %.2f %% of the diagonal (rms). ", scene.name.c_str(),
          scene.tetrahedra, 1e3 * scene.step_seconds, 100 * scene.rms);
    if (!scene.self.empty()) {
      print("ITSELF (%s): too large for finite elements; ", scene.self.c_str());
    } else if (scene.linear) {
      print("Quadratic; linear elements are off by %.0f %%, ", 100 * *scene.linear);
    } else {
      print("LINEAR elements, too stiff: too large for quadratic ones; ");
    }
    if (scene.self.empty()) {
      if (scene.refined) print("each cut into eight changed them by %.2g %%, ", 100 * *scene.refined);
      print("half the steps change %.2g %%, the neo-Hookean law %.1f %%, Sinew's own %.1f %%", 100 * scene.shorter,
            100 * scene.neo_hookean, 100 * scene.own_law);
    }
    text += "\n";
    if (scene.penalty) print("  a ground twice as firm changes %.2g %%\n", 100 * *scene.penalty);
    if (scene.turned) {
      print("  astray: path with the rigid motion; turned: degrees, against the reference at its end, which has %.0f\n",
            *scene.turned);
    }
    if (scene.lawMatters()) text += "  strains are so large that the law of elasticity matters: compare with care\n";
    print("  %-20s  %-38s  %8s  %7s  %7s  %7s  %7s  %6s  %6s\n", "method", "knobs", "ms/frame", "path, %", "end, %",
          "most, %", "vol., %", "freq.", "decay");
    for (const ErrorRow& row : study.rows) {
      if (row.scene != s) continue;
      print("%c %-20s  %-38s  %8.3f",
            row.front       ? '*'
            : row.own_front ? '.'
                            : ' ',
            nameOf(row.method).data(), row.knobs.c_str(), row.milliseconds);
      if (row.lost || row.slow) {
        text += row.slow ? "  too slow\n" : "  lost\n";
        continue;
      }
      print("  %7.1f  %7.1f  %7.1f  %7.2f", 100 * row.path, 100 * row.end, 100 * row.largest, 100 * row.volume);
      if (row.frequency) print("  %6.3f  %6.2f", *row.frequency, *row.decay);
      if (row.astray) print("  astray %6.1f, turned %3.0f", 100 * *row.astray, *row.turned);
      text += "\n";
    }
  }
  for (const std::string& note : study.notes) text += "note: " + note + "\n";
  return text +
         "\nErrors are shares of the reference's rms displacement (not moving: 100). path: over all frames. end: mean "
         "shape of the last quarter of a second.\n* nothing is nearer for less time; . nothing of this method is\n";
}

}  // namespace sinew::tools
