// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/json_text.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <set>
#include <utility>

#include "tools/core/error.h"
#include "tools/core/read_file.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

constexpr std::uint64_t kMostMegabytes = 64;
// Deeper than any recipe; parsing and checking recurse.
constexpr std::size_t kMaximumDepth = 64;

// Tells the reader how far the parser has come.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, const char** reached) : at_(at), reached_(reached) {}
  reference operator*() const { return *at_; }
  CountingIterator& operator++() {
    ++at_;
    *reached_ = at_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator before = *this;
    ++*this;
    return before;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }

 private:
  const char* at_;
  const char** reached_;
};

std::size_t lettersChanged(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row[b.size()];
}

}  // namespace

// Builds the values and their lines from the parser's events.
class JsonTextReader final : public nlohmann::json_sax<nlohmann::ordered_json> {
 public:
  using Json = nlohmann::ordered_json;

  JsonTextReader(JsonText& out, std::string_view text) : out_(out), text_(text), reached_(text.data()) {}

  void run() {
    const char* end = text_.data() + text_.size();
    Json::sax_parse(CountingIterator(text_.data(), &reached_), CountingIterator(end, &reached_), this,
                    nlohmann::json::input_format_t::json, true, true);
  }

  bool null() override { return take(nullptr); }
  bool boolean(bool value) override { return take(value); }
  bool number_integer(number_integer_t value) override { return takeNumber(value); }
  bool number_unsigned(number_unsigned_t value) override { return takeNumber(value); }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return takeNumber(value); }
  bool string(string_t& value) override { return take(value); }
  bool binary(binary_t& /*value*/) override { return false; }
  bool start_object(std::size_t /*elements*/) override { return open(Json::object()); }
  bool start_array(std::size_t /*elements*/) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& value) override {
    Level& level = levels_.back();
    if (!level.keys.insert(value).second) {
      throw ToolError(
          ExitCode::bad_input, out_.file_,
          "has the key '" + value + "' twice (line " + std::to_string(lineAt(reached_)) + ", " + level.pointer + ")",
          "Remove or rename one of them.");
    }
    level.key = value;
    return true;
  }
  bool parse_error(std::size_t position, const std::string& /*last*/,
                   const nlohmann::detail::exception& /*e*/) override {
    const std::size_t at = std::min(position == 0 ? 0 : position - 1, text_.size());
    throw ToolError(ExitCode::bad_input, out_.file_,
                    "is not valid JSON (line " + std::to_string(lineAt(text_.data() + at)) + ")",
                    "Mend the syntax there; a missing comma or quote is usual.");
  }

 private:
  struct Level {
    Json* value;
    std::string pointer;
    std::string key;
    std::set<std::string> keys;
  };

  std::uint32_t lineAt(const char* place) {
    line_ += std::uint32_t(std::count(counted_to_, std::max(place, counted_to_), '\n'));
    counted_to_ = std::max(place, counted_to_);
    return line_;
  }
  template <class Value>
  bool takeNumber(Value value) {
    // The parser has read one character beyond a number.
    const char* place = reached_;
    if (place > text_.data() && place < text_.data() + text_.size()) --place;
    return place_(Json(value), place) != nullptr;
  }
  template <class Value>
  bool take(const Value& value) {
    return place_(Json(value), reached_) != nullptr;
  }
  bool open(Json empty) {
    if (levels_.size() >= kMaximumDepth) {
      throw ToolError(ExitCode::bad_input, out_.file_,
                      "is nested deeper than " + std::to_string(kMaximumDepth) + " levels (line " +
                          std::to_string(lineAt(reached_)) + ")",
                      "Give inner selections names under masks.");
    }
    std::string pointer;
    Json* value = place_(std::move(empty), reached_, &pointer);
    levels_.push_back({value, std::move(pointer), {}, {}});
    return true;
  }
  bool close() {
    levels_.pop_back();
    return true;
  }
  Json* place_(Json value, const char* place, std::string* pointer_out = nullptr) {
    const std::uint32_t line = lineAt(place);
    std::string pointer;
    Json* at = &out_.json_;
    if (levels_.empty()) {
      *at = std::move(value);
    } else {
      Level& level = levels_.back();
      if (level.value->is_array()) {
        pointer = childPointer(level.pointer, level.value->size());
        level.value->push_back(std::move(value));
        at = &level.value->back();
      } else {
        pointer = childPointer(level.pointer, level.key);
        at = &((*level.value)[level.key] = std::move(value));
      }
    }
    out_.lines_[pointer] = line;
    if (pointer_out != nullptr) *pointer_out = pointer;
    return at;
  }

  JsonText& out_;
  std::string_view text_;
  const char* reached_;
  const char* counted_to_ = text_.data();
  std::uint32_t line_ = 1;
  std::vector<Level> levels_;
};

JsonText::JsonText(std::string_view text, std::string file) : file_(std::move(file)) {
  // Exporters on Windows begin files with a byte order mark.
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  JsonTextReader reader(*this, text);
  reader.run();
  // Strict JSON refuses comments, which this accepts.
  has_comments_ = !nlohmann::json::accept(text.begin(), text.end());
}

std::string JsonText::readFile(const std::string& file) { return readWholeFile(file, kMostMegabytes); }

JsonText JsonText::read(const std::string& file) { return {readFile(file), file}; }

std::uint32_t JsonText::line(std::string pointer) const {
  while (true) {
    const auto at = lines_.find(pointer);
    if (at != lines_.end()) return at->second;
    const std::size_t slash = pointer.rfind('/');
    if (slash == std::string::npos) return 0;
    pointer.resize(slash);
  }
}

void JsonText::fail(const std::string& pointer, const std::string& what, const std::string& cure) const {
  const std::uint32_t number = line(pointer);
  std::string place = number > 0 ? "line " + std::to_string(number) : "";
  if (!pointer.empty()) place += (place.empty() ? "" : ", ") + pointer.substr(1);
  throw ToolError(ExitCode::bad_input, file_, what + (place.empty() ? "" : " (" + place + ")"), cure);
}

std::string childPointer(const std::string& pointer, std::string_view key) {
  std::string out = pointer + "/";
  for (const char c : key) out += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return out;
}

std::string childPointer(const std::string& pointer, std::size_t index) {
  return pointer + "/" + std::to_string(index);
}

double sevenDigits(double x) { return std::strtod(rounded(x, 7).c_str(), nullptr); }

nlohmann::ordered_json jsonOf(const Eigen::Vector3d& point) {
  return {sevenDigits(point[0]), sevenDigits(point[1]), sevenDigits(point[2])};
}

Eigen::Vector3d pointOf(const nlohmann::ordered_json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

std::string nearestName(std::string_view wanted, std::span<const std::string> names) {
  if (names.empty()) return {};
  const auto distance = [&](const std::string& name) {
    return std::pair(!name.starts_with(wanted), lettersChanged(name, wanted));
  };
  return *std::min_element(names.begin(), names.end(),
                           [&](const std::string& a, const std::string& b) { return distance(a) < distance(b); });
}

}  // namespace sinew::tools
