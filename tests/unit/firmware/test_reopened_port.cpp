// A port that was closed and opened again: its codec starts over, before the new bytes.
#include <string>

#include "firmware/pipeline/host_report.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::firmware::CycleOutput;
using leadline::firmware::HostReport;
using leadline::firmware::InputChunk;
using leadline::firmware::Vehicle;

Vehicle vehicle;

/// A cycle with a host report, and bytes of the navigation's port in front of it.
void cycle(leadline::base::TimeUs t_us, std::uint16_t opens, const std::string& bytes) {
  HostReport report{};
  report.port_count = 2;
  for (int port = 0; port < 2; ++port) {
    report.port_open[port] = 1;
    report.opens[port] = opens;
  }
  std::uint8_t encoded[leadline::firmware::kMaxHostReport_bytes] = {};
  const std::size_t size = encode_host_report(report, encoded, sizeof encoded);
  const InputChunk chunks[] = {
      {t_us, reinterpret_cast<const std::uint8_t*>(bytes.data()),
       static_cast<std::uint16_t>(bytes.size()), leadline::test::kRigNavigation},
      {t_us, encoded, static_cast<std::uint16_t>(size), leadline::firmware::kHostPort}};
  CycleOutput output{};
  vehicle.cycle({t_us, chunks, 2, 100'000}, output);
}

TEST(half_a_sentence_is_forgotten_and_the_new_one_is_heard) {
  leadline::test::configure_rig(vehicle, leadline::test::rig_config());
  const std::string sentence = "$HEHDT,90.0,T*16\r\n";
  cycle(20'000, 1, sentence);
  assert_int_equal(vehicle.counters().nav_samples, 1);
  // Half a sentence, then the plug is pulled: what comes next is no continuation.
  cycle(40'000, 1, "$HEHDT,9");
  cycle(60'000, 2, "0.0,T*16\r\n");
  assert_int_equal(vehicle.counters().nav_samples, 1);
  assert_int_equal(vehicle.counters().ports[leadline::test::kRigNavigation].rejected, 1);
  cycle(80'000, 2, sentence);
  assert_int_equal(vehicle.counters().nav_samples, 2);
  // The report stands behind the bytes in its cycle, and still counts first.
  cycle(100'000, 2, "$HEHDT,9");
  cycle(120'000, 3, sentence);
  assert_int_equal(vehicle.counters().nav_samples, 3);
  assert_int_equal(vehicle.counters().ports[leadline::test::kRigNavigation].rejected, 2);
}

}  // namespace
