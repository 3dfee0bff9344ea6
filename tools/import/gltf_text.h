// SPDX-License-Identifier: GPL-3.0-or-later
//
// Readers of a glTF's text: its JSON with the place of every complaint, its URIs.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tools/import/readers.h"

namespace sinew::tools {

/// A place in the JSON with its path, so that every complaint names where it is.
class GltfValue {
 public:
  GltfValue(const nlohmann::json* value, std::string path) : json_(value), path_(std::move(path)) {}

  explicit operator bool() const { return json_ != nullptr; }
  const nlohmann::json& raw() const { return *json_; }
  const std::string& path() const { return path_; }

  [[noreturn]] void fail(const std::string& what) const {
    throw ReadError(what + " (at " + (path_.empty() ? "the top" : path_) + ")");
  }
  /// A member, or a GltfValue that is false where there is none or it is null.
  GltfValue get(const char* key) const {
    if (!json_) return {nullptr, path_ + "/" + key};
    if (!json_->is_object()) fail("the JSON has no object where one belongs");
    const auto at = json_->find(key);
    return {at == json_->end() || at->is_null() ? nullptr : &*at, path_ + "/" + key};
  }
  GltfValue need(const char* key) const {
    GltfValue value = get(key);
    if (!value) value.fail("the JSON lacks a required entry");
    return value;
  }
  std::size_t size() const {
    if (!json_) return 0;
    if (!json_->is_array()) fail("the JSON has no array where one belongs");
    return json_->size();
  }
  GltfValue at(std::size_t index) const {
    const std::string path = path_ + "/" + std::to_string(index);
    if (index >= size()) GltfValue(nullptr, path).fail("the JSON refers to an entry that does not exist");
    return {&(*json_)[index], path};
  }
  double number() const {
    if (!json_ || !json_->is_number()) fail("the JSON has no number where one belongs");
    const double value = json_->get<double>();
    if (!std::isfinite(value)) fail("a number is not finite");
    return value;
  }
  double number(const char* key, double otherwise) const {
    const GltfValue value = get(key);
    return value ? value.number() : otherwise;
  }
  std::uint64_t integer() const {
    if (!json_ || !json_->is_number()) fail("the JSON has no number where one belongs");
    if (json_->is_number_unsigned()) return json_->get<std::uint64_t>();
    const double value = json_->get<double>();
    if (!(value >= 0 && value < 9e15) || value != std::floor(value))
      fail("the JSON has no whole number of 0 or more where one belongs");
    return std::uint64_t(value);
  }
  std::uint64_t integer(const char* key, std::uint64_t otherwise) const {
    const GltfValue value = get(key);
    return value ? value.integer() : otherwise;
  }
  /// A whole number that names one of so many things.
  std::uint64_t index(const char* thing, std::size_t count) const {
    const std::uint64_t value = integer();
    if (value >= count)
      fail("names " + std::string(thing) + " " + std::to_string(value) + " of " + std::to_string(count));
    return value;
  }
  bool boolean(const char* key, bool otherwise) const {
    const GltfValue value = get(key);
    if (!value) return otherwise;
    if (!value.raw().is_boolean()) value.fail("the JSON has no true or false where one belongs");
    return value.raw().get<bool>();
  }
  std::string text(const char* key, const std::string& otherwise) const {
    const GltfValue value = get(key);
    if (!value) return otherwise;
    if (!value.raw().is_string()) value.fail("the JSON has no text where one belongs");
    return value.raw().get<std::string>();
  }
  template <std::size_t N>
  std::array<double, N> numbers(const char* key, const std::array<double, N>& otherwise) const {
    const GltfValue value = get(key);
    if (!value) return otherwise;
    if (value.size() != N)
      value.fail("the JSON has " + std::to_string(value.size()) + " numbers instead of " + std::to_string(N));
    std::array<double, N> out;
    for (std::size_t k = 0; k < N; ++k) out[k] = value.at(k).number();
    return out;
  }
  std::string dump() const {
    return json_ ? json_->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) : "{}";
  }

 private:
  const nlohmann::json* json_;
  std::string path_;
};

[[noreturn]] void unsupportedExtension(const std::string& name, const std::string& path);

std::string percentDecoded(std::string_view text);

/// The bytes of a data: URI; empty optional where it is none or damaged.
std::optional<std::string> dataUri(std::string_view uri);

inline constexpr std::uint32_t kMaxDepth = 128;  ///< levels of brackets
/// Whether JSON nests deeper than kMaxDepth.
bool tooDeep(std::string_view text);

}  // namespace sinew::tools
