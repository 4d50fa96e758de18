#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "model/base/crc32c.hpp"
#include "proto/log.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::crc32c;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::sample_hello;
using leadline::test::sample_log_header;
using leadline::test::sample_status;
using leadline::test::spec_block;
using namespace leadline::proto;  // NOLINT: every name of the header is under test
using BaseStatus = leadline::base::Status;

const Bytes kThree = {1, 2, 3};

LogBytes bytes_of(const Bytes& bytes) {
  return LogBytes{bytes.data(), static_cast<std::uint32_t>(bytes.size())};
}

/// The payloads that stand in the SPEC, one line each but for those that are wrapped.
Bytes spec_payload(std::uint8_t type) {
  const Bytes all = from_hex(spec_block("Vectors (payloads):"));
  const std::array<std::size_t, 7> sizes = {58, 9, 8, 17, 21, 22, 85};
  std::size_t at = 0;
  for (std::uint8_t i = 0; i < type - 0x80; ++i) {
    at += sizes[i];
  }
  const auto begin = all.begin() + static_cast<std::ptrdiff_t>(at);
  return {begin, begin + static_cast<std::ptrdiff_t>(sizes[type - 0x80U])};
}

/// As in test_messages: the SPEC's bytes both ways, shorter ones refused. `fixed` is what has to be there
/// before bytes of any number.
template <typename Encode, typename Decode>
void check_contract(const Bytes& golden, std::size_t fixed, Encode encode, Decode decode) {
  Bytes bytes(kMaxPayload_bytes);
  const auto size = encode(bytes.data(), bytes.size());
  assert_true(size.ok());
  bytes.resize(size.value());
  assert_true(bytes == golden);
  assert_true(decode(bytes.data(), bytes.size()).ok());
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    Bytes room(cut);
    assert_int_equal(static_cast<int>(encode(room.data(), cut).status()),
                     static_cast<int>(BaseStatus::kFull));
    std::copy_n(bytes.begin(), cut, room.begin());
    const auto status = decode(room.data(), cut).status();
    if (cut < fixed) {
      assert_int_equal(
          static_cast<int>(status),
          static_cast<int>(cut == 0 ? BaseStatus::kInvalidArgument : BaseStatus::kTruncated));
    }
  }
  Bytes other = bytes;
  other[0] = 0x3F;
  assert_int_equal(static_cast<int>(decode(other.data(), other.size()).status()),
                   static_cast<int>(BaseStatus::kInvalidArgument));
}

TEST(header_is_as_specified) {
  check_contract(
      spec_payload(0x80), 58,
      [](auto* out, auto size) { return encode_log_header(sample_log_header(), out, size); },
      decode_log_header);
  Bytes bytes = spec_payload(0x80);
  const LogHeader header = decode_log_header(bytes.data(), bytes.size()).value();
  assert_true(header.survey_id == 0x1122334455667788U);
  assert_true(header.utc_us == 1'700'000'000'000'000);
  assert_int_equal(header.tables[0].size_bytes, 5);
  const auto with = [&bytes](std::size_t at, std::uint8_t value) {
    Bytes changed = bytes;
    changed[at] = value;
    return static_cast<int>(decode_log_header(changed.data(), changed.size()).status());
  };
  assert_int_equal(with(1, 'X'), static_cast<int>(BaseStatus::kInvalidArgument));
  assert_int_equal(with(5, 0), static_cast<int>(BaseStatus::kBadVersion));
  assert_int_equal(with(5, 2), static_cast<int>(BaseStatus::kBadVersion));
  assert_int_equal(with(7, 2), static_cast<int>(BaseStatus::kBadVersion));
  assert_int_equal(with(49, 9), static_cast<int>(BaseStatus::kOutOfRange));
  LogHeader bad = sample_log_header();
  bad.format = 2;
  assert_int_equal(static_cast<int>(encode_log_header(bad, bytes.data(), bytes.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  bad = sample_log_header();
  bad.table_count = 9;
  assert_int_equal(static_cast<int>(encode_log_header(bad, bytes.data(), bytes.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(pieces_are_as_specified) {
  check_contract(
      spec_payload(0x81), 6,
      [](auto* out, auto size) {
        return encode_log_piece(MessageType::kLogConfig, {0, 0, {kThree.data(), 3}}, out, size);
      },
      decode_log_piece);
  check_contract(
      spec_payload(0x82), 6,
      [](auto* out, auto size) {
        return encode_log_piece(MessageType::kLogTable, {1, 4080, {kThree.data(), 2}}, out, size);
      },
      decode_log_piece);
  const Bytes bytes = spec_payload(0x82);
  const LogPiece piece = decode_log_piece(bytes.data(), bytes.size()).value();
  assert_int_equal(piece.table, 1);
  assert_int_equal(piece.offset_bytes, 4080);
  assert_int_equal(piece.bytes.size_bytes, 2);
  // A piece of nothing, of the wrong table, too long, of another type.
  Bytes out(kMaxPayload_bytes + 100);
  const auto status = [&out](MessageType type, const LogPiece& bad) {
    return static_cast<int>(encode_log_piece(type, bad, out.data(), out.size()).status());
  };
  const int range = static_cast<int>(BaseStatus::kOutOfRange);
  const Bytes longest(kMaxLogPiece_bytes + 1);
  assert_int_equal(status(MessageType::kLogTable, {0, 0, {kThree.data(), 0}}), range);
  assert_int_equal(status(MessageType::kLogTable, {8, 0, bytes_of(kThree)}), range);
  assert_int_equal(status(MessageType::kLogConfig, {1, 0, bytes_of(kThree)}), range);
  assert_int_equal(status(MessageType::kLogTable, {0, 0, bytes_of(longest)}), range);
  assert_int_equal(status(MessageType::kText, {0, 0, bytes_of(kThree)}), range);
  Bytes far = bytes;
  far[1] = 8;
  assert_int_equal(static_cast<int>(decode_log_piece(far.data(), far.size()).status()), range);
  assert_int_equal(static_cast<int>(decode_log_piece(far.data(), 6).status()), range);
}

TEST(chunk_is_as_specified) {
  check_contract(
      spec_payload(0x83), 14,
      [](auto* out, auto size) {
        return encode_log_chunk({1, 20'000, 2, bytes_of(kThree)}, out, size);
      },
      decode_log_chunk);
  const Bytes longest(kMaxLogChunk_bytes + 1);
  Bytes out(kMaxPayload_bytes + 100);
  assert_int_equal(
      static_cast<int>(
          encode_log_chunk({0, 0, 0, bytes_of(longest)}, out.data(), out.size()).status()),
      static_cast<int>(BaseStatus::kOutOfRange));
  Bytes payload = spec_payload(0x83);
  payload.resize(14 + kMaxLogChunk_bytes + 1);
  assert_int_equal(static_cast<int>(decode_log_chunk(payload.data(), payload.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  const auto empty = decode_log_chunk(payload.data(), 14);
  assert_true(empty.ok());
  assert_int_equal(empty.value().bytes.size_bytes, 0);
}

TEST(cycle_gap_and_end_are_as_specified) {
  check_contract(
      spec_payload(0x84), 21,
      [](auto* out, auto size) {
        return encode_log_cycle({1, 25'000, 1200, 1, 0}, out, size);
      },
      decode_log_cycle);
  check_contract(
      spec_payload(0x85), 22,
      [](auto* out, auto size) {
        return encode_log_gap({30'000, LogGapReason::kDiskFull, 4, 1000}, out, size);
      },
      decode_log_gap);
  check_contract(
      spec_payload(0x86), 85,
      [](auto* out, auto size) {
        return encode_log_end({40'000, 2, 1, 2, 3, 4, 5, 6, 7, 8, 9}, out, size);
      },
      decode_log_end);
  Bytes gap = spec_payload(0x85);
  gap[9] = 4;
  assert_int_equal(static_cast<int>(decode_log_gap(gap.data(), gap.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  assert_int_equal(
      static_cast<int>(
          encode_log_gap({0, static_cast<LogGapReason>(4), 0, 0}, gap.data(), gap.size()).status()),
      static_cast<int>(BaseStatus::kOutOfRange));
}

// --- Whole logs

Bytes blob_of(std::size_t size) {
  Bytes blob(size);
  for (std::size_t i = 0; i < size; ++i) {
    blob[i] = static_cast<std::uint8_t>(i * 7 + i / 256);
  }
  return blob;
}

constexpr std::uint32_t kGoldenCycles = 3;
// The golden file is of minor 0 of the messages.
constexpr std::uint32_t kGoldenSchemaHash = 0x13EDA2BF;

/// A survey of three cycles: two tables, one of two pieces, chunks with and without bytes, a hello, a
/// status and a tile delta in the downlink, a gap, an end.
Bytes golden_log() {
  Bytes log(60'000);
  LogWriter writer(log.data(), log.size());
  const Bytes config = blob_of(300);
  const Bytes small = blob_of(40);
  const Bytes large = blob_of(5000);
  LogHeader header = sample_log_header();
  header.schema_hash = kGoldenSchemaHash;
  header.config = {crc32c(config.data(), config.size()), 300};
  header.table_count = 2;
  header.tables[0] = {crc32c(small.data(), small.size()), 40};
  header.tables[1] = {crc32c(large.data(), large.size()), 5000};
  for (int copy = 0; copy < 2; ++copy) {
    assert_int_equal(static_cast<int>(writer.header(header)), 0);
    assert_int_equal(static_cast<int>(writer.config(config.data(), config.size())), 0);
    assert_int_equal(static_cast<int>(writer.table(0, small.data(), small.size())), 0);
    assert_int_equal(static_cast<int>(writer.table(1, large.data(), large.size())), 0);
  }
  LogEnd end{};
  for (std::uint32_t cycle = 0; cycle < kGoldenCycles; ++cycle) {
    const auto t_us = static_cast<std::int64_t>(cycle) * 100'000;
    for (std::uint32_t i = 0; i < cycle; ++i) {
      const Bytes input = blob_of(30 * i);
      LogChunk chunk{cycle, t_us - 10'000 + i, static_cast<std::uint8_t>(i), bytes_of(input)};
      assert_int_equal(static_cast<int>(writer.chunk(chunk)), 0);
    }
    LogCycle record{cycle, t_us, 1200, static_cast<std::uint16_t>(cycle),
                    static_cast<std::uint16_t>(cycle == 0 ? kLogCycleIdle : 0)};
    assert_int_equal(static_cast<int>(writer.cycle(record)), 0);
    Bytes payload(kMaxPayload_bytes);
    Bytes frame(frame_bound_bytes(kMaxPayload_bytes));
    std::size_t size = 0;
    if (cycle == 0) {
      Hello hello = sample_hello();
      hello.protocol_minor = 0;
      hello.schema_hash = kGoldenSchemaHash;
      size = encode_hello(hello, payload.data(), payload.size()).value();
    } else if (cycle == 1) {
      // Minor 0 knew no swath.
      Status status = sample_status();
      status.swath = Swath{};
      size = encode_status(status, payload.data(), payload.size()).value();
    } else {
      const auto cells = leadline::test::sample_tile();
      TileUpdate update{7, 300, cells.data(), leadline::test::all_cells()};
      CellMask taken{};
      size = encode_tile(update, 0xEB54, payload.data(), payload.size(), taken).value();
    }
    size = encode_frame(payload.data(), size, frame.data(), frame.size()).value();
    assert_int_equal(static_cast<int>(writer.frames(frame.data(), size)), 0);
    end.downlink_bytes += size;
  }
  assert_int_equal(static_cast<int>(writer.gap({250'000, LogGapReason::kRingFull, 2, 90})), 0);
  end.t_us = 300'000;
  end.cycle_count = kGoldenCycles;
  end.map_hash = 0x0123456789ABCDEF;
  end.cells_hash = 0xFEDCBA9876543210;
  end.link_hash = 0x0F1E2D3C4B5A6978;
  end.pings_in = 10;
  end.pings_fused = 7;
  end.pings_shed = 1;
  end.pings_rejected = 2;
  end.cells_sent = 256;
  assert_int_equal(static_cast<int>(writer.end(end)), 0);
  log.resize(writer.size_bytes());
  return log;
}

struct Read {
  std::vector<Bytes> records;  ///< payloads
  std::vector<bool> gaps;      ///< gap_before of each
  LogReaderCounters counters;
  bool mid_record;
};

Read read_log(const Bytes& log, std::size_t piece_bytes = 1 << 20) {
  Read read{};
  LogReader reader;
  for (std::size_t at = 0; at < log.size();) {
    std::size_t left = std::min(piece_bytes, log.size() - at);
    while (left > 0) {
      LogRecord record{};
      std::size_t used = 0;
      if (reader.next(log.data() + at, left, used, record)) {
        assert_int_equal(static_cast<int>(record.type), record.payload[0]);
        read.records.emplace_back(record.payload, record.payload + record.payload_bytes);
        read.gaps.push_back(record.gap_before);
      }
      at += used;
      left -= used;
    }
  }
  read.counters = reader.counters();
  read.mid_record = reader.mid_record();
  return read;
}

TEST(golden_log_reads_as_when_it_was_written) {
  // A released file: never to be written again. LEADLINE_WRITE_GOLDEN makes one for a new format.
  const std::string path = leadline::test::source_directory() + "/tests/data/golden/log_1.llog";
  const Bytes written = golden_log();
  if (std::getenv("LEADLINE_WRITE_GOLDEN") != nullptr) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(written.data()),
               static_cast<std::streamsize>(written.size()));
  }
  std::ifstream file(path, std::ios::binary);
  const Bytes log((std::istreambuf_iterator<char>(file)), {});
  assert_true(log == written);

  const Read read = read_log(log);
  assert_int_equal(read.records.size(), 21);
  assert_int_equal(read.counters.gaps, 0);
  assert_false(read.mid_record);
  const auto type = [&read](std::size_t i) { return int{read.records[i][0]}; };
  const std::array<int, 21> types = {0x80, 0x81, 0x82, 0x82, 0x82, 0x80, 0x81,
                                     0x82, 0x82, 0x82, 0x84, 0x01, 0x83, 0x84,
                                     0x03, 0x83, 0x83, 0x84, 0x02, 0x85, 0x86};
  for (std::size_t i = 0; i < types.size(); ++i) {
    assert_int_equal(type(i), types[i]);
  }
  // Its hello is older than the names.
  const auto hello = decode_hello(read.records[11].data(), read.records[11].size());
  assert_true(hello.ok());
  assert_int_equal(hello.value().protocol_minor, 0);
  assert_int_equal(hello.value().table_crc[1], 0xFFFFFFFF);
  assert_int_equal(hello.value().survey_name.size_bytes, 0);
  assert_int_equal(hello.value().vertical_datum.size_bytes, 0);
}

TEST(golden_log_carries_its_blobs) {
  const Read read = read_log(golden_log());
  const LogHeader header =
      decode_log_header(read.records[0].data(), read.records[0].size()).value();
  Bytes table;
  for (std::size_t i = 1; i < 5; ++i) {
    const auto piece = decode_log_piece(read.records[i].data(), read.records[i].size());
    assert_true(piece.ok());
    if (read.records[i][0] == 0x82 && piece.value().table == 1) {
      assert_int_equal(piece.value().offset_bytes, table.size());
      table.insert(table.end(), piece.value().bytes.data,
                   piece.value().bytes.data + piece.value().bytes.size_bytes);
    }
  }
  assert_int_equal(table.size(), header.tables[1].size_bytes);
  assert_int_equal(crc32c(table.data(), table.size()), header.tables[1].crc);
}

TEST(a_log_that_is_cut_loses_its_last_record_at_most) {
  const Bytes log = golden_log();
  const Read whole = read_log(log);
  // Where each record ends: at the delimiter behind it.
  std::size_t complete = 0;
  LogReader reader;
  for (std::size_t size = 0; size <= log.size(); ++size) {
    if (size > 0) {
      LogRecord record{};
      std::size_t used = 0;
      complete += reader.next(&log[size - 1], 1, used, record) ? 1 : 0;
    }
    if (size % 7 != 0 && size + 200 < log.size()) {
      continue;  // the counts above tell it byte by byte; whole reads now and then
    }
    const Read cut = read_log(Bytes(log.begin(), log.begin() + static_cast<std::ptrdiff_t>(size)));
    assert_int_equal(cut.records.size(), complete);
    for (std::size_t i = 0; i < complete; ++i) {
      assert_true(cut.records[i] == whole.records[i]);
    }
    assert_int_equal(cut.counters.gaps, 0);
  }
  assert_int_equal(complete, whole.records.size());
}

TEST(a_changed_byte_costs_one_record_at_most) {
  const Bytes log = golden_log();
  const Read whole = read_log(log);
  for (std::size_t at = 0; at < log.size(); ++at) {
    for (const std::uint8_t change : Bytes{0x01, 0x80, 0xFF, log[at]}) {
      Bytes changed = log;
      changed[at] = static_cast<std::uint8_t>(changed[at] ^ change);
      if (changed[at] == log[at]) {
        continue;  // it was a zero, and is to be one
      }
      const Read read = read_log(changed);
      assert_true(read.records.size() + 1 >= whole.records.size());
      // What is there is what was there, in order, and what is not is told.
      std::size_t from = 0;
      for (std::size_t i = 0; i < read.records.size(); ++i) {
        const bool gap_here = read.records[i] != whole.records[from];
        from += gap_here ? 1 : 0;
        assert_true(from < whole.records.size() && read.records[i] == whole.records[from]);
        assert_int_equal(read.gaps[i], gap_here);
        ++from;
      }
      const bool lost = read.records.size() < whole.records.size();
      const bool told = read.counters.gaps == 1 || read.mid_record;
      assert_int_equal(lost, told);
    }
  }
}

TEST(pieces_of_any_size_read_alike) {
  const Bytes log = golden_log();
  const Read whole = read_log(log);
  for (const std::size_t piece : {1, 2, 3, 17, 1000}) {
    assert_true(read_log(log, piece).records == whole.records);
  }
}

TEST(a_full_span_is_left_as_it_was) {
  const Bytes log = golden_log();
  Bytes span(500, 0xEE);
  for (std::size_t capacity = 0; capacity < 400; ++capacity) {
    LogWriter writer(span.data(), capacity);
    const BaseStatus first = writer.header(sample_log_header());
    const std::size_t size = writer.size_bytes();
    assert_int_equal(first == BaseStatus::kOk, size > 0);
    const Bytes blob(5000);
    assert_int_equal(static_cast<int>(writer.table(0, blob.data(), blob.size())),
                     static_cast<int>(BaseStatus::kFull));
    assert_int_equal(writer.size_bytes(), size);
    assert_int_equal(static_cast<int>(writer.frames(log.data(), capacity + 1)),
                     static_cast<int>(BaseStatus::kFull));
    assert_int_equal(writer.size_bytes(), size);
  }
  LogWriter writer(span.data(), span.size());
  assert_int_equal(static_cast<int>(writer.frames(nullptr, 0)), 0);
  assert_int_equal(static_cast<int>(writer.frames(kThree.data(), 3)), 0);
  assert_memory_equal(writer.data(), kThree.data(), 3);
  writer.clear();
  assert_int_equal(writer.size_bytes(), 0);
  // What the encoders refuse is passed on.
  LogHeader bad = sample_log_header();
  bad.format = 0;
  assert_int_equal(static_cast<int>(writer.header(bad)), static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(blobs_stay_within_their_bound) {
  for (const std::size_t size : {0, 1, 4080, 4081, 20'000}) {
    const Bytes blob = blob_of(size);
    Bytes span(log_blob_bound_bytes(size));
    LogWriter writer(span.data(), span.size());
    assert_int_equal(static_cast<int>(writer.config(blob.data(), size)), 0);
    assert_true(writer.size_bytes() <= span.size());
  }
}

TEST(types_of_a_newer_minor_are_skipped) {
  Bytes log = golden_log();
  const std::size_t records = read_log(log).records.size();
  const Bytes payload = {0x99, 1, 2};
  Bytes frame(100);
  frame.resize(encode_frame(payload.data(), payload.size(), frame.data(), frame.size()).value());
  Bytes longer = frame;
  longer.insert(longer.end(), log.begin(), log.end());
  const Read read = read_log(longer);
  assert_int_equal(read.records.size(), records);
  assert_int_equal(read.counters.unknown_types, 1);
  assert_int_equal(read.counters.gaps, 0);
}

}  // namespace
