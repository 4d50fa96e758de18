// A log of any bytes, in pieces of any size: the cut does not matter, counters add up, and every record that
// is delivered was a frame with its CRC.
#include <cstdint>
#include <cstring>
#include <vector>

#include "proto/log.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;

using namespace leadline::proto;  // NOLINT: every name of the header is under test

struct Record {
  std::vector<std::uint8_t> payload;
  bool gap_before;
  bool operator==(const Record& other) const {
    return payload == other.payload && gap_before == other.gap_before;
  }
};

std::vector<Record> read_all(const std::uint8_t* data, std::size_t size, std::size_t piece,
                             LogReaderCounters& counters, bool& mid_record) {
  LogReader reader;
  std::vector<Record> records;
  std::size_t at = 0;
  while (at < size) {
    std::size_t left = piece < size - at ? piece : size - at;
    while (left > 0) {
      LogRecord record{};
      std::size_t used = 0;
      if (reader.next(data + at, left, used, record)) {
        require(static_cast<std::uint8_t>(record.type) == record.payload[0]);
        records.push_back(
            {{record.payload, record.payload + record.payload_bytes}, record.gap_before});
      } else {
        require(used == left);
      }
      at += used;
      left -= used;
    }
  }
  counters = reader.counters();
  mid_record = reader.mid_record();
  require(counters.records == records.size());
  require(reader.frame_counters().frames == counters.records + counters.unknown_types);
  require(counters.gaps <= reader.frame_counters().bad_frames());
  return records;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  LogReaderCounters whole{};
  LogReaderCounters pieces{};
  bool whole_mid = false;
  bool pieces_mid = false;
  const auto at_once = read_all(data + 1, size - 1, size, whole, whole_mid);
  const auto cut = read_all(data + 1, size - 1, 1 + std::size_t{data[0]}, pieces, pieces_mid);
  require(at_once == cut && whole.gaps == pieces.gaps && whole_mid == pieces_mid);
  return 0;
}
