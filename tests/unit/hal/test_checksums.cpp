#include "hal/checksums.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using namespace leadline::hal;  // NOLINT: the file tests one header
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::from_text;

const Bytes kCheck = from_text("123456789");

}  // namespace

// The catalogue's check values.
TEST(check_values) {
  assert_int_equal(crc16_xmodem(kCheck.data(), kCheck.size()), 0x31C3);
  assert_int_equal(crc16_xmodem(kCheck.data(), kCheck.size(), 0xFFFF), 0x29B1);
  assert_int_equal(crc16_modbus(kCheck.data(), kCheck.size()), 0x4B37);
  assert_int_equal(crc16_mcrf4xx(kCheck.data(), kCheck.size()), 0x6F91);
  assert_int_equal(crc8(kCheck.data(), kCheck.size()), 0xF4);
  assert_int_equal(xor8(kCheck.data(), kCheck.size()), 0x31);
  assert_int_equal(sum16(kCheck.data(), kCheck.size()), 0x01DD);
}

TEST(continue_over_a_second_block) {
  const std::size_t cut = 4;
  const auto rest = kCheck.size() - cut;
  const std::uint8_t* tail = kCheck.data() + cut;
  assert_int_equal(crc16_xmodem(tail, rest, crc16_xmodem(kCheck.data(), cut)), 0x31C3);
  assert_int_equal(crc16_modbus(tail, rest, crc16_modbus(kCheck.data(), cut)), 0x4B37);
  assert_int_equal(crc16_mcrf4xx(tail, rest, crc16_mcrf4xx(kCheck.data(), cut)), 0x6F91);
  assert_int_equal(crc8(tail, rest, crc8(kCheck.data(), cut)), 0xF4);
}

// Frames of devices.md: a PNI request, a constant of another PNI driver, a Modbus request.
TEST(frames_of_devices) {
  const Bytes pni = from_hex("00 05 01");
  assert_int_equal(crc16_xmodem(pni.data(), pni.size()), 0xEFD4);
  const Bytes poll = from_hex("00 17 05 04");
  assert_int_equal(crc16_xmodem(poll.data(), poll.size()), 0x7982);
  const Bytes modbus = from_hex("01 03 01 00 00 04");
  assert_int_equal(crc16_modbus(modbus.data(), modbus.size()), 0xF545);
}

TEST(sum_wraps_at_16_bits) {
  const Bytes many(300, 0xFF);
  assert_int_equal(sum16(many.data(), many.size()), (300 * 0xFF) & 0xFFFF);
}
