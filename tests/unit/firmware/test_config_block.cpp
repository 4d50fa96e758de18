#include <cstring>
#include <vector>

#include "firmware/pipeline/config_block.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::config_block_bytes;
using leadline::firmware::ConfigBlock;
using leadline::firmware::encode_config_block;
using leadline::firmware::kConfigBlockHeader_bytes;
using leadline::firmware::kMaxTables;
using leadline::firmware::read_config_block;
using leadline::test::Random;
using leadline::test::rig_table;

// What the vehicle reads lies at an aligned address; a vector's bytes need not.
class Region {
 public:
  explicit Region(const std::vector<std::uint8_t>& bytes, std::size_t room_bytes)
      : words_(room_bytes / 8 + 1, 0xFFFFFFFFFFFFFFFFU) {
    std::memcpy(data(), bytes.data(), bytes.size());
  }
  [[nodiscard]] std::uint8_t* data() { return reinterpret_cast<std::uint8_t*>(words_.data()); }

 private:
  std::vector<std::uint64_t> words_;
};

ConfigBlock rig_block(std::size_t table_count) {
  ConfigBlock block{};
  block.config = leadline::test::rig_config();
  block.cycle_us = 20'000;
  for (unsigned i = 0; i < 8; ++i) {
    block.port_baud[i] = 9600U * (i + 1U);
  }
  block.link_baud = 57'600;
  block.table_count = table_count;
  for (std::size_t i = 0; i < table_count && i < kMaxTables; ++i) {
    block.tables[i] = {&rig_table(), sizeof rig_table()};
  }
  return block;
}

std::vector<std::uint8_t> bytes_of(const ConfigBlock& block) {
  std::vector<std::uint8_t> bytes(config_block_bytes(block));
  const auto size = encode_config_block(block, bytes.data(), bytes.size());
  assert_true(size.ok());
  assert_int_equal(size.value(), bytes.size());
  return bytes;
}

void put_crc(std::vector<std::uint8_t>& bytes) {
  const std::uint32_t crc = leadline::base::crc32c(bytes.data() + 16, bytes.size() - 16);
  for (unsigned i = 0; i < 4; ++i) {
    bytes[12 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  }
}

Status read(const std::vector<std::uint8_t>& bytes) {
  Region region(bytes, bytes.size());
  ConfigBlock out{};
  return read_config_block(region.data(), bytes.size(), out);
}

TEST(what_was_put_in_comes_out) {
  for (std::size_t tables = 0; tables <= kMaxTables; ++tables) {
    const ConfigBlock block = rig_block(tables);
    const auto bytes = bytes_of(block);
    Region flash(bytes, bytes.size() + 4096);  // erased behind the block
    ConfigBlock back{};
    assert_int_equal(read_config_block(flash.data(), bytes.size() + 4096, back), Status::kOk);
    assert_int_equal(back.cycle_us, 20'000);
    assert_int_equal(back.port_baud[7], 76'800);
    assert_int_equal(back.link_baud, 57'600);
    assert_int_equal(back.table_count, tables);
    for (std::size_t i = 0; i < tables; ++i) {
      assert_int_equal(back.tables[i].size_bytes, sizeof rig_table());
      assert_memory_equal(back.tables[i].bytes, &rig_table(), sizeof rig_table());
      assert_int_equal(reinterpret_cast<std::uintptr_t>(back.tables[i].bytes) % 8, 0);
    }
    assert_int_equal(back.config.survey_id, block.config.survey_id);
    const auto again = bytes_of(back);
    assert_memory_equal(again.data(), bytes.data(), bytes.size());
  }
}

TEST(a_vehicle_takes_what_was_read) {
  static leadline::firmware::Vehicle vehicle;
  const auto bytes = bytes_of(rig_block(1));
  Region flash(bytes, bytes.size());
  ConfigBlock block{};
  assert_int_equal(read_config_block(flash.data(), bytes.size(), block), Status::kOk);
  assert_int_equal(vehicle.configure(block.config, block.tables, block.table_count), Status::kOk);
}

TEST(damaged_blocks_are_refused_by_reason) {
  const auto bytes = bytes_of(rig_block(1));
  for (std::size_t size = 0; size < bytes.size(); size += size < 300 ? 1 : 97) {
    Region region(bytes, bytes.size());
    ConfigBlock out{};
    assert_int_equal(read_config_block(region.data(), size, out), Status::kTruncated);
  }
  for (std::size_t at = 0; at < bytes.size(); at += at < 300 ? 1 : 97) {
    if (at == 6 || at == 7) {
      continue;  // reserved
    }
    auto wrong = bytes;
    wrong[at] ^= 0x10U;
    const Status status = read(wrong);
    if (at < 4) {
      assert_int_equal(status, Status::kInvalidArgument);
    } else if (at < 6) {
      assert_int_equal(status, Status::kBadVersion);
    } else if (at < 12) {  // another length: the CRC is of other bytes
      assert_true(status == Status::kTruncated || status == Status::kBadChecksum);
    } else {
      assert_int_equal(status, Status::kBadChecksum);
    }
  }
  ConfigBlock out{};
  assert_int_equal(read_config_block(nullptr, 1000, out), Status::kInvalidArgument);
  Region region(bytes, bytes.size() + 8);
  assert_int_equal(read_config_block(region.data() + 4, bytes.size(), out),
                   Status::kInvalidArgument);
}

TEST(lying_headers_stay_within_the_block) {
  // A right CRC over wrong fields: never read beyond, and what is accepted lies inside.
  Random random(2);
  const auto bytes = bytes_of(rig_block(2));
  int accepted = 0;
  for (int i = 0; i < 3'000; ++i) {
    auto wrong = bytes;
    for (std::int64_t k = random.between(1, 3); k > 0; --k) {
      const auto at = static_cast<std::size_t>(
          random.between(16, static_cast<std::int64_t>(kConfigBlockHeader_bytes) - 1));
      wrong[at] = static_cast<std::uint8_t>(random.next());
    }
    put_crc(wrong);
    Region region(wrong, wrong.size());
    ConfigBlock out{};
    if (read_config_block(region.data(), wrong.size(), out) != Status::kOk) {
      continue;
    }
    ++accepted;
    for (std::size_t t = 0; t < out.table_count; ++t) {
      const auto* const first = static_cast<const std::uint8_t*>(out.tables[t].bytes);
      assert_true(first >= region.data() + kConfigBlockHeader_bytes);
      assert_true(first + out.tables[t].size_bytes <= region.data() + wrong.size());
    }
  }
  assert_true(accepted > 100);  // baud rates are anybody's
}

TEST(limits_of_the_writer) {
  ConfigBlock block = rig_block(1);
  std::vector<std::uint8_t> room(config_block_bytes(block));
  assert_int_equal(encode_config_block(block, room.data(), room.size() - 1).status(),
                   Status::kFull);
  for (const std::int32_t cycle_us : {999, 1'000'001, 0, -1}) {
    block.cycle_us = cycle_us;
    assert_int_equal(encode_config_block(block, room.data(), room.size()).status(),
                     Status::kOutOfRange);
  }
  block = rig_block(kMaxTables + 1);
  assert_int_equal(config_block_bytes(block), 0);
  assert_int_equal(encode_config_block(block, room.data(), room.size()).status(),
                   Status::kOutOfRange);
}

}  // namespace
