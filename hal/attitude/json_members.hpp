// The members of one JSON object in one line of text, without a tree: for reports whose keys are known
// and whose values of interest are not nested. No heap, no recursion.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/text_fields.hpp"

namespace leadline::hal {

struct JsonMember {
  TextField key;  ///< between its quotes, escapes as they stand
  TextField
      value;  ///< a number, true, false or null; a string without its quotes; empty when nested
  bool is_string = false;
};

/// Goes through an object's members in order. Nested objects and arrays are stepped over, whatever
/// their depth, and their brackets only counted. What is no object ends with next() false and good()
/// false. O(size) in all.
class JsonMembers {
 public:
  /// `text` stays the caller's.
  JsonMembers(const char* text, std::size_t size) : text_(text), size_(size) {
    if (!take('{')) {
      (void)fail();
    } else if (take('}')) {
      finish();
    }
  }

  /// The next member; false behind the last, or where the text is no JSON.
  [[nodiscard]] bool next(JsonMember& member) {
    if (done_) {
      return false;
    }
    if (!take_string(member.key) || !take(':') || !take_value(member)) {
      return fail();
    }
    if (take('}')) {
      finish();
      return good_;
    }
    return take(',') || fail();
  }
  /// False once something was found that is no object with nothing behind it.
  [[nodiscard]] bool good() const { return good_; }

 private:
  [[nodiscard]] bool fail() {
    good_ = false;
    done_ = true;
    return false;
  }

  void finish() {
    skip_spaces();
    good_ = at_ == size_;
    done_ = true;
  }

  void skip_spaces() {
    while (at_ < size_ && (text_[at_] == ' ' || text_[at_] == '\t')) {
      ++at_;
    }
  }

  [[nodiscard]] bool take(char wanted) {
    skip_spaces();
    if (at_ == size_ || text_[at_] != wanted) {
      return false;
    }
    ++at_;
    return true;
  }

  [[nodiscard]] bool take_string(TextField& string) {
    if (!take('"')) {
      return false;
    }
    const std::size_t start = at_;
    while (at_ < size_ && text_[at_] != '"') {
      at_ += text_[at_] == '\\' ? 2U : 1U;
    }
    if (at_ >= size_) {
      return false;
    }
    string = {text_ + start, at_ - start};
    ++at_;
    return true;
  }

  /// Of numbers and of true, false, null.
  [[nodiscard]] static bool is_plain(char c) {
    return is_digit(c) || (upper(c) >= 'A' && upper(c) <= 'Z') || c == '+' || c == '-' || c == '.';
  }

  [[nodiscard]] bool take_value(JsonMember& member) {
    skip_spaces();
    member.is_string = at_ < size_ && text_[at_] == '"';
    if (member.is_string) {
      return take_string(member.value);
    }
    member.value = {};
    if (at_ < size_ && (text_[at_] == '{' || text_[at_] == '[')) {
      return step_over();
    }
    const std::size_t start = at_;
    while (at_ < size_ && is_plain(text_[at_])) {
      ++at_;
    }
    member.value = {text_ + start, at_ - start};
    return at_ > start;
  }

  [[nodiscard]] bool step_over() {
    std::size_t depth = 0;
    while (at_ < size_) {
      const char c = text_[at_];
      TextField ignored;
      if (c == '"') {
        if (!take_string(ignored)) {
          return false;
        }
        continue;
      }
      ++at_;
      if (c == '{' || c == '[') {
        ++depth;
      } else if ((c == '}' || c == ']') && --depth == 0) {
        return true;
      }
    }
    return false;
  }

  const char* text_;
  std::size_t size_;
  std::size_t at_ = 0;
  bool good_ = true;
  bool done_ = false;
};

}  // namespace leadline::hal
