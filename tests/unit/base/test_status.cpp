#include <set>
#include <string>

#include "model/base/status.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Result;
using leadline::base::Status;
using leadline::base::status_text;

TEST(every_status_has_its_own_text) {
  std::set<std::string> texts;
  const int last = static_cast<int>(Status::kEmpty);
  for (int value = 0; value <= last; ++value) {
    const char* text = status_text(static_cast<Status>(value));
    assert_non_null(text);
    texts.insert(text);
  }
  assert_int_equal(texts.size(), last + 1);
  // A value from a damaged log.
  assert_string_equal(status_text(static_cast<Status>(255)), "unknown status");
}

TEST(result_carries_a_value_or_a_reason) {
  const Result<int> good = 7;
  assert_true(good.ok());
  assert_int_equal(good.status(), Status::kOk);
  assert_int_equal(good.value(), 7);
  const Result<int> bad = Status::kFull;
  assert_true(!bad.ok());
  assert_int_equal(bad.status(), Status::kFull);
  assert_int_equal(bad.value(), 0);
}

}  // namespace
