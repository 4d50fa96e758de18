#include <cstring>
#include <vector>

#include "firmware/pipeline/config_codec.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::config_blob_bytes;
using leadline::firmware::decode_config;
using leadline::firmware::encode_config;
using leadline::firmware::kMaxConfigBlob_bytes;
using leadline::firmware::VehicleConfig;
using leadline::test::Random;

std::vector<std::uint8_t> blob_of(const VehicleConfig& config) {
  std::vector<std::uint8_t> blob(kMaxConfigBlob_bytes);
  const auto size = encode_config(config, blob.data(), blob.size());
  assert_true(size.ok());
  blob.resize(size.value());
  return blob;
}

void put_crc(std::vector<std::uint8_t>& blob) {
  const std::uint32_t crc = leadline::base::crc32c(blob.data() + 16, blob.size() - 16);
  for (unsigned i = 0; i < 4; ++i) {
    blob[12 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  }
}

TEST(every_byte_of_a_blob_comes_back) {
  // Random bodies with legal enumerators: decoded and encoded again they are the same bytes, so every field
  // is read from where it is written, at its full width.
  Random random(1);
  VehicleConfig base = leadline::test::rig_config();
  base.extract_interval_us = 0x01010101;
  base.link.coarse_wait_us = 0x01010101;  // no byte makes it 0
  std::vector<std::uint8_t> blob = blob_of(base);
  assert_int_equal(blob.size(), config_blob_bytes(base));
  assert_true(blob.size() <= kMaxConfigBlob_bytes);
  int decoded_count = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::vector<std::uint8_t> trial = blob;
    trial[static_cast<std::size_t>(
        random.between(16, static_cast<std::int64_t>(blob.size()) - 1))] =
        static_cast<std::uint8_t>(random.next());
    put_crc(trial);
    const auto decoded = decode_config(trial.data(), trial.size());
    if (!decoded.ok()) {
      assert_int_equal(decoded.status(), Status::kOutOfRange);
      continue;
    }
    ++decoded_count;
    const std::vector<std::uint8_t> again = blob_of(decoded.value());
    assert_memory_equal(again.data(), trial.data(), trial.size());
  }
  assert_true(decoded_count > 19'000);
}

TEST(values_come_back) {
  VehicleConfig config = leadline::test::rig_config();
  config.navigation.magnetic_variation_bam32 = -123'456;
  config.model.origin_mm[1] = -(std::int64_t{1} << 40U);
  config.mounts[3].lever_arm_mm[2] = -7;
  config.ports[7].latency_us = -1;
  config.session = 0xDEADBEEF;
  const auto blob = blob_of(config);
  const VehicleConfig back = decode_config(blob.data(), blob.size()).value();
  assert_int_equal(back.navigation.magnetic_variation_bam32, -123'456);
  assert_int_equal(back.model.origin_mm[1], -(std::int64_t{1} << 40U));
  assert_int_equal(back.mounts[3].lever_arm_mm[2], -7);
  assert_int_equal(back.ports[7].latency_us, -1);
  assert_int_equal(back.session, 0xDEADBEEF);
  assert_int_equal(back.survey_id, config.survey_id);
  assert_int_equal(back.link.mtu_bytes, config.link.mtu_bytes);
  assert_int_equal(static_cast<int>(back.model.rule), static_cast<int>(config.model.rule));
}

TEST(an_interval_of_extraction_is_in_the_blob_only_where_there_is_one) {
  VehicleConfig config = leadline::test::rig_config();
  const std::vector<std::uint8_t> without = blob_of(config);
  config.extract_interval_us = 1'500'000;
  std::vector<std::uint8_t> blob = blob_of(config);
  assert_int_equal(blob.size(), without.size() + 4);
  assert_int_equal(config_blob_bytes(config), blob.size());
  assert_memory_equal(blob.data() + 16, without.data() + 16, without.size() - 16);
  assert_int_equal(decode_config(without.data(), without.size()).value().extract_interval_us, 0);
  assert_int_equal(decode_config(blob.data(), blob.size()).value().extract_interval_us, 1'500'000);
  // One form for each configuration: 0 is not written.
  for (std::size_t i = without.size(); i < blob.size(); ++i) {
    blob[i] = 0;
  }
  put_crc(blob);
  assert_int_equal(decode_config(blob.data(), blob.size()).status(), Status::kOutOfRange);
  // And none in version 1.
  config.schema_version = 1;
  const std::vector<std::uint8_t> old = blob_of(config);
  assert_int_equal(decode_config(old.data(), old.size()).value().extract_interval_us, 0);
}

TEST(a_wait_for_coarse_cells_is_in_the_blob_behind_the_interval) {
  VehicleConfig config = leadline::test::rig_config();
  const std::vector<std::uint8_t> without = blob_of(config);
  config.link.coarse_wait_us = 5'000'000;
  std::vector<std::uint8_t> blob = blob_of(config);
  assert_int_equal(blob.size(), without.size() + 8);
  assert_int_equal(config_blob_bytes(config), blob.size());
  const VehicleConfig back = decode_config(blob.data(), blob.size()).value();
  assert_int_equal(back.extract_interval_us, 0);
  assert_int_equal(back.link.coarse_wait_us, 5'000'000);
  assert_int_equal(decode_config(without.data(), without.size()).value().link.coarse_wait_us, 0);
  for (std::size_t i = without.size(); i < blob.size(); ++i) {
    blob[i] = 0;
  }
  put_crc(blob);
  assert_int_equal(decode_config(blob.data(), blob.size()).status(), Status::kOutOfRange);
}

TEST(a_blob_of_version_1_reads_with_what_it_lacks_at_zero) {
  VehicleConfig config = leadline::test::rig_config();
  config.ports[7].max_returns = 3;
  config.ports[7].quality_weight_percent = 80;
  std::vector<std::uint8_t> blob = blob_of(config);
  const VehicleConfig whole = decode_config(blob.data(), blob.size()).value();
  assert_int_equal(whole.ports[7].max_returns, 3);
  assert_int_equal(whole.ports[7].quality_weight_percent, 80);
  // As version 1 wrote it: without the two fields of eight ports, and the window and the store; its version in the
  // header and in the body.
  blob.resize(blob.size() - 2 * 4 * 8 - 4 - 2);
  blob[4] = blob[16] = 1;
  for (unsigned i = 0; i < 4; ++i) {
    blob[8 + i] = static_cast<std::uint8_t>(blob.size() >> (8 * i));
  }
  put_crc(blob);
  const VehicleConfig back = decode_config(blob.data(), blob.size()).value();
  assert_int_equal(back.schema_version, 1);
  const std::vector<std::uint8_t> again = blob_of(back);
  assert_int_equal(again.size(), blob.size());
  assert_memory_equal(again.data(), blob.data(), blob.size());
  assert_int_equal(back.ports[7].max_returns, 0);
  assert_int_equal(back.ports[7].quality_weight_percent, 0);
  assert_int_equal(back.survey_id, config.survey_id);
  assert_string_equal(back.vertical_datum, config.vertical_datum);
  blob[4] = 3;
  assert_int_equal(decode_config(blob.data(), blob.size()).status(), Status::kBadVersion);
  blob[4] = 0;
  assert_int_equal(decode_config(blob.data(), blob.size()).status(), Status::kBadVersion);
}

TEST(damaged_blobs_are_refused_by_reason) {
  const auto blob = blob_of(leadline::test::rig_config());
  for (std::size_t size = 0; size < blob.size(); ++size) {
    assert_int_equal(decode_config(blob.data(), size).status(), Status::kTruncated);
  }
  assert_int_equal(decode_config(nullptr, 100).status(), Status::kTruncated);
  for (std::size_t at = 0; at < blob.size(); ++at) {
    auto wrong = blob;
    wrong[at] ^= 0x10U;
    const Status status = decode_config(wrong.data(), wrong.size()).status();
    if (at == 6 || at == 7) {
      continue;  // reserved
    }
    assert_true(status != Status::kOk);
    if (at < 4) {
      assert_int_equal(status, Status::kInvalidArgument);
    } else if (at < 6) {
      assert_int_equal(status, Status::kBadVersion);
    } else if (at >= 12) {
      assert_int_equal(status, Status::kBadChecksum);
    }
  }
  auto longer = blob;
  longer.push_back(0);
  assert_int_equal(decode_config(longer.data(), longer.size()).status(), Status::kInvalidArgument);
  std::uint8_t small[16];
  assert_int_equal(encode_config(leadline::test::rig_config(), small, sizeof(small)).status(),
                   Status::kFull);
}

}  // namespace
