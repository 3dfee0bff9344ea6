// SPDX-License-Identifier: GPL-3.0-or-later
// Stands in for the import's child process and misbehaves as the file's text tells it to.
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <string>

#include "tools/import/raw_scene.h"
#include "tools/import/worker_protocol.h"

namespace sinew::tools {
namespace {

int output = -1;

void send(const void* data, std::size_t size) {
  const auto* bytes = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(output, bytes, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) std::_Exit(9);
    bytes += n;
    size -= std::size_t(n);
  }
}

class Sink : public ByteSink {
 public:
  void write(const void* data, std::size_t size) override { bytes.append(static_cast<const char*>(data), size); }
  std::string bytes;
};

RawScene goodScene() {
  RawScene scene;
  RawMesh mesh;
  mesh.name = "tet";
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.vertex_point = {0, 1, 2, 3};
  mesh.corners = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  mesh.face_size = {3, 3, 3, 3};
  mesh.parts = {{"tet", formats::kNone}};
  scene.meshes.push_back(mesh);
  return scene;
}

std::string serialized(const RawScene& scene) {
  Sink sink;
  sink.bytes = char(WorkerAnswer::scene);
  writeRawScene(scene, sink);
  return sink.bytes;
}

void sendChanged(const std::function<void(RawScene&, RawMesh&)>& change) {
  RawScene scene = goodScene();
  change(scene, scene.meshes[0]);
  const std::string bytes = serialized(scene);
  send(bytes.data(), bytes.size());
}

void noCore() {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
}

int misbehave(const std::string& how) {
  noCore();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::map<std::string, std::function<void(RawScene&, RawMesh&)>> changes = {
      {"good", [](RawScene&, RawMesh&) {}},
      {"corner", [](RawScene&, RawMesh& m) { m.corners[5] = 4; }},
      {"corners", [](RawScene&, RawMesh& m) { m.corners.pop_back(); }},
      {"point", [](RawScene&, RawMesh& m) { m.vertex_point[2] = 77; }},
      {"nan", [nan](RawScene&, RawMesh& m) { m.points[3].y() = double(nan); }},
      {"face size", [](RawScene&, RawMesh& m) { m.face_size[0] = 2; }},
      {"face overflow",
       [](RawScene&, RawMesh& m) {
         m.face_size = {0xffffffffU, 0xffffffffU, 0xffffffffU, 15};
       }},
      {"part",
       [](RawScene&, RawMesh& m) {
         m.face_part = {0, 0, 0, 1};
       }},
      {"no part", [](RawScene&, RawMesh& m) { m.parts.clear(); }},
      {"material", [](RawScene&, RawMesh& m) { m.parts[0].material = 0; }},
      {"texture",
       [](RawScene& s, RawMesh&) {
         s.materials.push_back({"m", {1, 1, 1, 1}, 3, false});
       }},
      {"colour",
       [nan](RawScene& s, RawMesh&) {
         s.materials.push_back({"m", {1, nan, 1, 1}, formats::kNone, false});
       }},
      {"node", [](RawScene&, RawMesh& m) { m.node = 0; }},
      {"node order",
       [](RawScene& s, RawMesh&) {
         s.nodes = {{"a", 0, "{}"}};
       }},
      {"transform", [nan](RawScene&, RawMesh& m) { m.transform(1, 1) = double(nan); }},
      {"normals", [](RawScene&, RawMesh& m) { m.normals.resize(3); }},
      {"uvs", [](RawScene&, RawMesh& m) { m.uvs.resize(5); }},
      {"attribute",
       [](RawScene&, RawMesh& m) {
         m.attributes.push_back({"a", 2, std::vector<float>(7)});
       }},
      {"components",
       [](RawScene&, RawMesh& m) {
         m.attributes.push_back({"a", 0, {}});
       }},
      {"joint",
       [](RawScene&, RawMesh& m) {
         m.skin_count = {1, 0, 0, 0}, m.skin = {{0, 1.0F}};
       }},
      {"skin",
       [](RawScene& s, RawMesh& m) {
         s.joints = {"j"}, m.skin_count = {1, 1, 1, 1}, m.skin = {{0, 1.0F}};
       }},
      {"morph",
       [](RawScene&, RawMesh& m) {
         m.morphs.push_back({"m", {4}, {Eigen::Vector3f(0, 0, 0)}});
       }},
      {"group set",
       [](RawScene&, RawMesh& m) {
         m.face_groups = {0, 0, 0, 0};
       }},
      {"group",
       [](RawScene& s, RawMesh& m) {
         s.group_sets = {{3}}, m.face_groups = {0, 0, 0, 0};
       }},
      {"ranges",
       [](RawScene&, RawMesh& m) {
         m.ranges = {{"r", 1, 3}};
       }},
      {"unit", [](RawScene& s, RawMesh&) { s.metres_per_unit = -1; }},
      {"axis", [](RawScene& s, RawMesh&) { s.up_axis = 3; }},
      {"severity",
       [](RawScene& s, RawMesh&) {
         s.findings.push_back({"x", static_cast<Severity>(9), "", 1, "", {}, "", ""});
       }},
  };
  if (const auto change = changes.find(how); change != changes.end()) {
    sendChanged(change->second);
    return 0;
  }
  if (how.rfind("cut ", 0) == 0) {
    const std::string bytes = serialized(goodScene());
    send(bytes.data(), std::min<std::size_t>(bytes.size(), std::stoul(how.substr(4))));
    return 0;
  }
  if (how.rfind("flip ", 0) == 0) {
    std::string bytes = serialized(goodScene());
    const std::size_t bit = std::stoul(how.substr(5)) % (bytes.size() * 8);
    bytes[bit / 8] = char(bytes[bit / 8] ^ 1 << bit % 8);
    send(bytes.data(), bytes.size());
    return 0;
  }
  if (how == "crash") std::raise(SIGSEGV);
  if (how == "abort") std::raise(SIGABRT);
  if (how == "crash at the end") {
    sendChanged([](RawScene&, RawMesh&) {});
    std::raise(SIGSEGV);
  }
  if (how == "hang") {
    while (true) pause();
  }
  if (how == "hang at the end") {
    sendChanged([](RawScene&, RawMesh&) {});
    while (true) pause();
  }
  if (how == "flood") {
    const std::string bytes(1U << 20, '\1');
    while (true) send(bytes.data(), bytes.size());
  }
  if (how == "lie") {
    // A plausible start, then a count of a trillion nodes.
    std::string bytes = serialized(goodScene()).substr(0, 1 + 4 + 8 + 8 + 4);
    const std::uint64_t count = 1'000'000'000'000ULL;
    bytes.append(reinterpret_cast<const char*>(&count), 8);
    send(bytes.data(), bytes.size());
    while (true) pause();
  }
  if (how == "complaint") {
    std::string bytes(1, char(WorkerAnswer::complaint));
    for (const std::string& text : {std::string("line one\nline two \x1b[31m"), std::string("Cure.")}) {
      const auto size = std::uint32_t(text.size());
      bytes.append(reinterpret_cast<const char*>(&size), 4);
      bytes += text;
    }
    send(bytes.data(), bytes.size());
    return 0;
  }
  if (how == "exit") return 5;
  return 0;
}

}  // namespace
}  // namespace sinew::tools

int main(int argument_count, char** arguments) {
  if (argument_count < 5) return 1;
  std::ifstream in(arguments[2]);
  std::string how;
  std::getline(in, how);
  sinew::tools::output = std::atoi(arguments[4]);
  return sinew::tools::misbehave(how);
}
