// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace sinew::tools {

/// Walks over the text of a mesh file: lines, blank-separated words, numbers. Never leaves its range.
/// Understands LF, CRLF and CR line ends, tabs, a UTF-8 byte order mark, and (where asked) `\` at a line's end.
class TextCursor {
 public:
  explicit TextCursor(std::string_view text, bool continuations = false)
      : at_(text.data()), end_(text.data() + text.size()), continuations_(continuations) {
    if (text.starts_with("\xEF\xBB\xBF")) at_ += 3;
  }

  bool atEnd() const { return at_ == end_; }
  std::uint64_t line() const { return line_; }
  std::string_view rest() const { return {at_, std::size_t(end_ - at_)}; }

  /// Skips blanks within the line.
  void skipBlanks() {
    while (at_ != end_) {
      if (*at_ == ' ' || *at_ == '\t' || *at_ == '\v' || *at_ == '\f') {
        ++at_;
      } else if (continuations_ && *at_ == '\\' && lineEndAt(at_ + 1)) {
        ++at_;
        takeLineEnd();
      } else {
        return;
      }
    }
  }
  bool atLineEnd() {
    skipBlanks();
    return lineEndAt(at_);
  }
  /// The next word of this line; empty at the line's end.
  std::string_view word() {
    skipBlanks();
    const char* start = at_;
    while (!lineEndAt(at_) && *at_ != ' ' && *at_ != '\t' && *at_ != '\v' && *at_ != '\f' &&
           !(continuations_ && *at_ == '\\' && lineEndAt(at_ + 1)))
      ++at_;
    return {start, std::size_t(at_ - start)};
  }
  /// The next word of this line; empty at its end or at a comment, which may follow a number at once.
  std::string_view wordBeforeComment() {
    const std::string_view found = word();
    const std::size_t at = found.find('#');
    const std::string_view left = at == found.npos ? "" : found.substr(at);
    // "1.#INF", "-1.#IND", "1.#QNAN", "1.#SNAN": as MSVC's printf writes what is not finite.
    if (at == found.npos || left.starts_with("#IN") || left.starts_with("#QNAN") || left.starts_with("#SNAN"))
      return found;
    lineRest();
    return found.substr(0, at);
  }
  /// All that is left of this line, without blanks at its ends.
  std::string_view lineRest() {
    skipBlanks();
    const char* start = at_;
    while (!lineEndAt(at_)) ++at_;
    const char* stop = at_;
    while (stop != start && (stop[-1] == ' ' || stop[-1] == '\t')) --stop;
    return {start, std::size_t(stop - start)};
  }
  void nextLine() {
    while (!lineEndAt(at_)) ++at_;
    takeLineEnd();
  }
  /// The next word, over line ends; empty at the end of the text.
  std::string_view wordAnywhere() {
    while (!atEnd() && atLineEnd()) takeLineEnd();
    return word();
  }

 private:
  bool lineEndAt(const char* p) const { return p == end_ || *p == '\n' || *p == '\r'; }
  void takeLineEnd() {
    if (at_ == end_) return;
    if (*at_ == '\r' && at_ + 1 != end_ && at_[1] == '\n') ++at_;
    ++at_;
    ++line_;
  }
  const char* at_;
  const char* end_;
  std::uint64_t line_ = 1;
  bool continuations_;
};

/// A whole word as a number, independent of the locale; "nan" and "inf" are numbers here (the caller refuses them),
/// an overflow is infinite, an underflow 0. Empty where the word is no number.
inline std::optional<double> parseNumber(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::invalid_argument) {
    // MSVC's printf writes these.
    if (word.find("#IND") != word.npos || word.find("#QNAN") != word.npos || word.find("#SNAN") != word.npos)
      return std::numeric_limits<double>::quiet_NaN();
    return std::nullopt;
  }
  if (stop != word.data() + word.size()) {
    if (word.find(".#") != word.npos) return std::numeric_limits<double>::quiet_NaN();  // "1.#INF", "-1.#IND"
    return std::nullopt;
  }
  if (error == std::errc::result_out_of_range)
    return word.find("e-") != word.npos || word.find("E-") != word.npos ? 0.0 : std::numeric_limits<double>::infinity();
  return value;
}

inline std::optional<std::int64_t> parseInteger(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  std::int64_t value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || stop != word.data() + word.size() || word.empty()) return std::nullopt;
  return value;
}

}  // namespace sinew::tools
