// SPDX-License-Identifier: MIT
//
// Prints how long PackageView::open() takes on a package of about 10 MB (or argv[1] megabytes): many copies of the
// sample package with fields as bodies of one package, without its picture. Or on the package argv[1].
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace {

using namespace sinew;

formats::PackageContent many(std::size_t copies) {
  formats::PackageContent content = test::fieldPackage();
  content.textures.clear();
  content.texture_bytes.clear();
  for (auto& material : content.materials) material.texture = formats::kNone;
  return test::repeated(std::move(content), copies);
}

std::vector<std::byte> contentOf(const char* path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> chars{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::byte> bytes(chars.size());
  std::memcpy(bytes.data(), chars.data(), chars.size());
  return bytes;
}

std::vector<std::byte> made(double megabytes) {
  const std::size_t once = formats::writePackage(many(1000)).size();
  return formats::writePackage(many(std::max<std::size_t>(1, std::size_t(megabytes * 1e9 / double(once)))));
}

}  // namespace

int main(int argc, char** argv) {
  const double megabytes = argc > 1 ? std::atof(argv[1]) : 10;
  const test::AlignedBytes bytes(megabytes > 0 ? made(megabytes) : contentOf(argv[1]));
  std::vector<double> milliseconds;
  for (int k = 0; k < 51; ++k) {
    formats::PackageView view;
    const auto start = std::chrono::steady_clock::now();
    const std::string reason = formats::PackageView::open(bytes.span(), view).reason;
    milliseconds.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    if (!reason.empty()) {
      std::fprintf(stderr, "open_package_time: %s\n", reason.c_str());
      return 1;
    }
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::printf("%.2f MB: median %.3f ms, fastest %.3f ms, slowest %.3f ms\n", double(bytes.span().size()) / 1e6,
              milliseconds[25], milliseconds.front(), milliseconds.back());
  return 0;
}
