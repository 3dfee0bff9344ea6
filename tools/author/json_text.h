// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

namespace sinew::tools {

/// JSON that knows on which line of its file each value stands, so that messages can say it.
class JsonText {
 public:
  JsonText() = default;

  /// Parses JSON; comments (`//` and `/* */`) are read over. Throws ToolError(bad_input) naming `file` and the line for
  /// a wrong syntax and for a key that occurs twice in one object.
  JsonText(std::string_view text, std::string file);
  /// Reads and parses a file. Throws ToolError(bad_input) also where it cannot be read or is larger than 64 MB.
  static JsonText read(const std::string& file);
  /// The bytes alone, with the same errors.
  static std::string readFile(const std::string& file);

  const nlohmann::ordered_json& json() const { return json_; }
  const std::string& file() const { return file_; }
  /// The same text's lines for other JSON: what a migration made of it.
  JsonText with(nlohmann::ordered_json json) const {
    JsonText copy = *this;
    copy.json_ = std::move(json);
    return copy;
  }
  bool hasComments() const { return has_comments_; }

  /// Throws ToolError(bad_input): "FILE: WHAT (line N, POINTER). CURE".
  /// \param pointer JSON pointer ("/clusters/0/from") of the value at fault; one that does not exist has its parent's
  /// line.
  [[noreturn]] void fail(const std::string& pointer, const std::string& what, const std::string& cure) const;
  /// Line of a value, from 1; 0 where the text is unknown (a value that no file holds).
  std::uint32_t line(std::string pointer) const;

 private:
  friend class JsonTextReader;
  std::string file_;
  nlohmann::ordered_json json_;
  std::map<std::string, std::uint32_t> lines_;
  bool has_comments_ = false;
};

/// One step down a JSON pointer; escapes ~ and / in `key`.
std::string childPointer(const std::string& pointer, std::string_view key);
std::string childPointer(const std::string& pointer, std::size_t index);

/// A number as people write it, of seven digits.
double sevenDigits(double x);
/// Three numbers of such digits.
nlohmann::ordered_json jsonOf(const Eigen::Vector3d& point);
/// Of an array of three numbers.
Eigen::Vector3d pointOf(const nlohmann::ordered_json& json);

/// Of `names` the one that is nearest to `wanted`: of those that begin with it, else of all, the one with the fewest
/// letters changed. Ties: the first. Empty where there are none.
std::string nearestName(std::string_view wanted, std::span<const std::string> names);

}  // namespace sinew::tools
