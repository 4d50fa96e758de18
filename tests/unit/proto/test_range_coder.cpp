#include <vector>

#include "proto/range_coder.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::proto::BitModel;
using leadline::proto::RangeDecoder;
using leadline::proto::RangeEncoder;
using leadline::test::Random;

/// A symbol: a bit under one of eight models, or raw bits.
struct Symbol {
  std::size_t model;
  std::uint32_t value;
  unsigned raw_bits;
};

std::vector<Symbol> random_symbols(Random& random) {
  std::vector<Symbol> symbols;
  const auto count = random.between(0, 400);
  const auto skew = random.between(1, 200);
  for (std::int64_t i = 0; i < count; ++i) {
    Symbol symbol{static_cast<std::size_t>(random.between(0, 7)), 0, 0};
    if (random.between(0, 9) == 0) {
      symbol.raw_bits = static_cast<unsigned>(random.between(0, 16));
      symbol.value = static_cast<std::uint32_t>(random.next()) & ((1U << symbol.raw_bits) - 1U);
      symbol.model = 8;
    } else {
      symbol.value = random.between(0, skew) == 0 ? 0 : 1;
    }
    symbols.push_back(symbol);
  }
  return symbols;
}

std::vector<std::uint8_t> encoded(const std::vector<Symbol>& symbols) {
  std::vector<std::uint8_t> body(2000);
  std::vector<BitModel> models(8, BitModel{16384, 16384});
  RangeEncoder coder;
  coder.start(body.data(), body.size());
  for (const Symbol& symbol : symbols) {
    if (symbol.model == 8) {
      coder.put_raw(symbol.value, symbol.raw_bits);
    } else {
      coder.put(models[symbol.model], symbol.value != 0);
    }
  }
  const std::size_t needed = coder.needed_bytes();
  body.resize(coder.finish());
  assert_true(body.size() <= needed);
  return body;
}

/// Whether `body` gives these symbols back and ends well.
bool decodes_to(const std::vector<std::uint8_t>& body, const std::vector<Symbol>& symbols) {
  std::vector<BitModel> models(8, BitModel{16384, 16384});
  RangeDecoder coder;
  coder.start(body.data(), body.size());
  bool same = true;
  for (const Symbol& symbol : symbols) {
    const std::uint32_t got = symbol.model == 8 ? coder.get_raw(symbol.raw_bits)
                                                : (coder.get(models[symbol.model]) ? 1U : 0U);
    same = same && got == symbol.value;
  }
  return coder.finished_exactly() && same;
}

TEST(what_was_put_is_what_is_got) {
  Random random;
  for (int i = 0; i < 5000; ++i) {
    const auto symbols = random_symbols(random);
    const auto body = encoded(symbols);
    assert_true(body.empty() || body.back() != 0);
    assert_true(decodes_to(body, symbols));
  }
}

TEST(a_body_that_is_cut_or_longer_is_told) {
  Random random(1);
  int cut_unnoticed = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto symbols = random_symbols(random);
    auto body = encoded(symbols);
    body.push_back(1);
    assert_false(decodes_to(body, symbols));
    body.back() = 0;
    assert_false(decodes_to(body, symbols));
    body.pop_back();
    if (body.size() > 1) {
      body.pop_back();
      cut_unnoticed += decodes_to(body, symbols) ? 1 : 0;
    }
  }
  assert_int_equal(cut_unnoticed, 0);
}

TEST(probabilities_stay_in_bounds_and_cost_stays_bounded) {
  BitModel model{16384, 16384};
  std::vector<std::uint8_t> body(4000);
  RangeEncoder coder;
  coder.start(body.data(), body.size());
  for (int i = 0; i < 100'000; ++i) {
    coder.put(model, true);
  }
  assert_in_range(model.fast_q15, 32'000, 32'704);
  // A certain bit costs at least 64 / 32768 of one nat: 0.0028 bits.
  const std::size_t sure_bytes = coder.needed_bytes();
  assert_in_range(sure_bytes, 1, 100);
  for (int i = 0; i < 100'000; ++i) {
    coder.put(model, false);
  }
  assert_in_range(model.fast_q15, 64, 800);
  assert_in_range(coder.needed_bytes(), sure_bytes, 300);
}

TEST(nothing_is_written_beyond_the_capacity) {
  for (std::size_t capacity = 0; capacity < 20; ++capacity) {
    std::vector<std::uint8_t> body(40, 0xA5);
    RangeEncoder coder;
    coder.start(body.data(), capacity);
    for (std::uint32_t i = 0; i < 20; ++i) {
      coder.put_raw(0xABCD, 16);
    }
    assert_true(coder.needed_bytes() > capacity);
    static_cast<void>(coder.finish());
    for (std::size_t i = capacity; i < body.size(); ++i) {
      assert_int_equal(body[i], 0xA5);
    }
  }
}

TEST(a_copy_is_a_state_to_come_back_to) {
  Random random(2);
  for (int round = 0; round < 2000; ++round) {
    const auto symbols = random_symbols(random);
    const auto straight = encoded(symbols);
    std::vector<std::uint8_t> body(2000);
    std::vector<BitModel> models(8, BitModel{16384, 16384});
    RangeEncoder coder;
    coder.start(body.data(), body.size());
    for (const Symbol& symbol : symbols) {
      const RangeEncoder before = coder;
      const auto models_before = models;
      for (int k = 0; k < 20; ++k) {
        coder.put_raw(static_cast<std::uint32_t>(random.next() & 0xFFFFU), 16);
      }
      coder = before;
      models = models_before;
      if (symbol.model == 8) {
        coder.put_raw(symbol.value, symbol.raw_bits);
      } else {
        coder.put(models[symbol.model], symbol.value != 0);
      }
    }
    body.resize(coder.finish());
    assert_true(body == straight);
  }
}

TEST(any_bytes_decode_to_something_and_stay_inside) {
  Random random(5);
  for (int i = 0; i < 3000; ++i) {
    std::vector<std::uint8_t> body(static_cast<std::size_t>(random.between(0, 40)));
    for (auto& byte : body) {
      byte = random.between(0, 3) == 0 ? 0xFF : static_cast<std::uint8_t>(random.next());
    }
    RangeDecoder coder;
    coder.start(body.data(), body.size());
    BitModel model{16384, 16384};
    for (int k = 0; k < 200; ++k) {
      static_cast<void>(coder.get(model));
      assert_true(coder.get_raw(7) < 128);
    }
    static_cast<void>(coder.finished_exactly());
  }
}

TEST(vector_of_the_specification) {
  std::vector<std::uint8_t> body(10);
  BitModel model{16384, 16384};
  RangeEncoder coder;
  coder.start(body.data(), body.size());
  for (const char bit : std::string("0000000010000000")) {
    coder.put(model, bit == '1');
  }
  coder.put_raw(0x2A, 6);
  body.resize(coder.finish());
  assert_true(body == std::vector<std::uint8_t>({0xFE, 0x98, 0x1D}));
  assert_int_equal(model.fast_q15, 7178);
  assert_int_equal(model.slow_q15, 14708);
}

}  // namespace
