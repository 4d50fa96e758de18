// A vector with its capacity in the type: no heap, no exceptions, trivially copyable elements.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "model/base/status.hpp"

namespace leadline::base {

/// Up to `kCapacity` elements, contiguous, in order of insertion. Trivially copyable itself, so that it
/// can travel through rings and logs. Not thread-safe. Every call is O(1) unless stated.
template <typename T, std::size_t kCapacity>
class FixedVector {
  static_assert(std::is_trivially_copyable_v<T>, "records are copied as bytes");
  static_assert(kCapacity > 0, "a vector of nothing holds nothing");

 public:
  /// kFull when there is no room: the vector is unchanged.
  [[nodiscard]] Status push_back(const T& value) {
    if (size_ == kCapacity) {
      return Status::kFull;
    }
    items_[size_] = value;
    ++size_;
    return Status::kOk;
  }
  /// kEmpty when there is nothing to take.
  [[nodiscard]] Status pop_back() {
    if (size_ == 0) {
      return Status::kEmpty;
    }
    --size_;
    return Status::kOk;
  }
  void clear() { size_ = 0; }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool full() const { return size_ == kCapacity; }

  /// Element `index`; an index beyond the last reads the last slot, never outside the storage.
  [[nodiscard]] const T& operator[](std::size_t index) const {
    return items_[index < kCapacity ? index : kCapacity - 1];
  }
  [[nodiscard]] T& operator[](std::size_t index) {
    return items_[index < kCapacity ? index : kCapacity - 1];
  }
  [[nodiscard]] const T* data() const { return items_.data(); }
  [[nodiscard]] const T* begin() const { return items_.data(); }
  [[nodiscard]] const T* end() const { return items_.data() + size_; }

 private:
  std::array<T, kCapacity> items_{};
  std::size_t size_ = 0;
};

}  // namespace leadline::base
