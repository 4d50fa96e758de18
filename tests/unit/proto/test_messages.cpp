#include <cstring>

#include "proto/framing.hpp"
#include "proto/messages.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::Bytes;
using leadline::test::Random;
using leadline::test::sample_hello;
using leadline::test::sample_resend_request;
using leadline::test::sample_status;
using leadline::test::sample_text;
using leadline::test::spec_block;
using leadline::test::spec_bytes;
using namespace leadline::proto;  // NOLINT: every name of the header is under test
using BaseStatus = leadline::base::Status;

template <typename Message, typename Encode>
Bytes encoded(const Message& message, Encode encode) {
  Bytes bytes(kMaxPayload_bytes);
  const auto size = encode(message, bytes.data(), bytes.size());
  assert_true(size.ok());
  bytes.resize(size.value());
  return bytes;
}

/// What every pair of encoder and decoder keeps: the SPEC's bytes both ways; any shorter room or payload
/// is refused; bytes of a newer minor behind are ignored; another type is not taken. What minor 1 added to a message
/// is not in one of minor 0: its length is good as well.
template <typename Message, typename Encode, typename Decode>
void check_contract(const Message& message, const Bytes& golden, Encode encode, Decode decode,
                    std::size_t added_bytes = 0) {
  const Bytes bytes = encoded(message, encode);
  assert_true(bytes == golden);
  const auto back = decode(bytes.data(), bytes.size());
  assert_true(back.ok());
  assert_true(encoded(back.value(), encode) == golden);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Bytes room(size);
    assert_int_equal(static_cast<int>(encode(message, room.data(), size).status()),
                     static_cast<int>(BaseStatus::kFull));
    const Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    if (added_bytes != 0 && size == bytes.size() - added_bytes) {
      assert_true(decode(cut.data(), size).ok());
      continue;
    }
    assert_int_equal(
        static_cast<int>(decode(cut.data(), size).status()),
        static_cast<int>(size == 0 ? BaseStatus::kInvalidArgument : BaseStatus::kTruncated));
  }
  Bytes longer = bytes;
  longer.insert(longer.end(), {0xFF, 0x00, 0x7F});
  assert_true(decode(longer.data(), longer.size()).ok());
  Bytes other = bytes;
  other[0] = 0x3F;
  assert_int_equal(static_cast<int>(decode(other.data(), other.size()).status()),
                   static_cast<int>(BaseStatus::kInvalidArgument));
}

TEST(hello_is_as_specified) {
  check_contract(sample_hello(), spec_bytes("survey tag `EB54`:"), encode_hello, decode_hello);
  const Bytes bytes = encoded(sample_hello(), encode_hello);
  const Hello hello = decode_hello(bytes.data(), bytes.size()).value();
  assert_true(hello.survey_id == 0x1122334455667788U);
  assert_true(hello.origin_mm[0] == -1000 && hello.origin_mm[2] == 11'000);
  assert_true(hello.longitude_e9deg == -10'125'000'000);
  assert_int_equal(hello.table_crc[1], 0xFFFFFFFF);
  assert_int_equal(survey_tag(hello.survey_id, hello.session), 0xEB54);
  assert_int_not_equal(survey_tag(hello.survey_id, hello.session + 1), 0xEB54);
}

TEST(status_is_as_specified) {
  check_contract(sample_status(), spec_bytes("Status (values in"), encode_status, decode_status, 8);
  const Bytes bytes = encoded(sample_status(), encode_status);
  const Status status = decode_status(bytes.data(), bytes.size()).value();
  assert_int_equal(status.alarms, kAlarmMappingPaused | kAlarmShed);
  assert_int_equal(status.position_mm[1], -1);
  assert_int_equal(status.pings[15], 225);
  assert_int_equal(status.recorder_lost, 0xFFFFFFFF);
  assert_int_equal(status.ports[0].bytes_in, 123'456);
  assert_int_equal(status.ports[1].state, 0);
}

TEST(brief_is_as_specified) {
  check_contract(brief_of(sample_status()), spec_bytes("Brief of that status"), encode_brief,
                 decode_brief, 8);
  Brief brief = brief_of(sample_status());
  assert_int_equal(brief.position_cm[0], 1234);
  assert_int_equal(brief.sigma_horizontal_cm, 9);
  // The farthest of everything is still within the bound, and comes back.
  brief = {UINT32_MAX,
           UINT32_MAX,
           7,
           {214'748'364, -214'748'364, 1},
           UINT16_MAX,
           UINT16_MAX,
           UINT32_MAX,
           UINT32_MAX,
           UINT32_MAX,
           UINT32_MAX,
           {2, {{255, -64, UINT16_MAX}, {255, 64, UINT16_MAX}}}};
  const Bytes bytes = encoded(brief, encode_brief);
  assert_true(bytes.size() <= kMaxBrief_bytes);
  const Brief back = decode_brief(bytes.data(), bytes.size()).value();
  assert_memory_equal(back.position_cm, brief.position_cm, sizeof brief.position_cm);
  assert_int_equal(back.cells_sent, UINT32_MAX);
  assert_memory_equal(&back.swath, &brief.swath, sizeof brief.swath);
  // Beyond straight down, and more beams than there are.
  brief.swath.beams[1].depression_bam8 = 65;
  Bytes room(kMaxBrief_bytes);
  assert_false(encode_brief(brief, room.data(), room.size()).ok());
  Bytes wrong = bytes;
  wrong[wrong.size() - 1 - std::size_t{5} * 2] = 3;
  assert_false(decode_brief(wrong.data(), wrong.size()).ok());
}

TEST(a_brief_brings_a_status_up_to_date) {
  Status status = sample_status();
  Status later = status;
  later.t_us += 2'345'000;
  later.alarms = kAlarmNoPose;
  later.position_mm[1] = -55'550;
  later.sigma_position_cm[1] = 70;
  later.pings[kPingFused] = 900;
  later.tiles_dirty = 0;
  later.cells_sent = 123'456;
  later.nav_fused = 1;  // not in a brief
  apply_brief(brief_of(later), status);
  assert_true(status.t_us == later.t_us);
  assert_int_equal(status.alarms, kAlarmNoPose);
  assert_int_equal(status.position_mm[0], 12'340);
  assert_int_equal(status.position_mm[1], -55'550);
  assert_int_equal(status.sigma_position_cm[0], 70);
  assert_int_equal(status.pings[kPingFused], 900);
  assert_int_equal(status.tiles_dirty, 0);
  assert_int_equal(status.cells_sent, 123'456);
  assert_int_equal(status.nav_fused, 300);
  // One that was late: time goes back, and through the wrap of its milliseconds.
  Status early = sample_status();
  early.t_us = -7000;
  apply_brief(brief_of(early), status);
  assert_true(status.t_us == -7000);
}

std::string text_of(const HelloText& text) { return {text.text, text.size_bytes}; }

TEST(names_of_a_hello_fit_the_link) {
  Hello hello = sample_hello();
  const Bytes bytes = encoded(hello, encode_hello);
  const Hello back = decode_hello(bytes.data(), bytes.size()).value();
  assert_string_equal(text_of(back.survey_name).c_str(), "Kieler F\xC3\xB6rde");
  assert_string_equal(text_of(back.vertical_datum).c_str(), "NHN");

  // The least MTU: one table leaves 25 bytes, the datum takes its own first; a character is not split.
  hello.table_count = 1;
  const std::size_t least = max_payload_bytes(128);
  name_survey(hello, "012345678901234567890\xC3\xB6", "NHN", least);
  assert_string_equal(text_of(hello.vertical_datum).c_str(), "NHN");
  assert_string_equal(text_of(hello.survey_name).c_str(), "012345678901234567890");
  assert_int_equal(encoded(hello, encode_hello).size(), least - 1);
  name_survey(hello, "0123456789012345678901", "NHN", least);
  assert_int_equal(encoded(hello, encode_hello).size(), least);
  // Seven tables: a byte is left; and no room at all is no error.
  hello.table_count = 7;
  name_survey(hello, "name", "MSL", least);
  assert_string_equal(text_of(hello.vertical_datum).c_str(), "M");
  assert_int_equal(hello.survey_name.size_bytes, 0);
  assert_int_equal(encoded(hello, encode_hello).size(), least);
  name_survey(hello, "name", nullptr, 0);
  assert_int_equal(hello.survey_name.size_bytes, 0);
  // Not terminated at the configuration's 64 bytes; nothing behind a control character.
  name_survey(hello, std::string(70, 'n').c_str(), "a\nb", kMaxPayload_bytes);
  assert_int_equal(hello.survey_name.size_bytes, kMaxHelloText_bytes);
  assert_string_equal(text_of(hello.vertical_datum).c_str(), "a");
}

TEST(a_hello_of_minor_0_has_no_names) {
  Hello hello = sample_hello();
  hello.protocol_minor = 0;
  const Bytes bytes = encoded(hello, encode_hello);
  assert_int_equal(bytes.size(), kLeastHello_bytes - 6 + 8);
  const Hello back = decode_hello(bytes.data(), bytes.size()).value();
  assert_int_equal(back.survey_name.size_bytes, 0);
  assert_int_equal(back.vertical_datum.size_bytes, 0);
  assert_int_equal(back.link_rate_bytes_s, 0);
}

TEST(hello_request_says_the_version) {
  std::uint8_t payload[4] = {0, 0, 0, 0xFF};
  for (std::size_t room = 0; room < kHelloRequest_bytes; ++room) {
    assert_int_equal(static_cast<int>(encode_hello_request(payload, room).status()),
                     static_cast<int>(BaseStatus::kFull));
  }
  assert_int_equal(encode_hello_request(payload, sizeof payload).value(), kHelloRequest_bytes);
  assert_true(Bytes(payload, payload + 3) == spec_bytes("Hello request: of 1.1"));
  const auto status_of = [&payload](std::size_t size) {
    return static_cast<int>(decode_hello_request(payload, size).status());
  };
  // A newer minor may say more.
  for (const std::size_t size : {3U, 4U}) {
    assert_int_equal(decode_hello_request(payload, size).value().protocol_major, 1);
    assert_int_equal(decode_hello_request(payload, size).value().protocol_minor, 1);
  }
  assert_int_equal(decode_hello_request(payload, 1).value().protocol_major, 1);
  assert_int_equal(decode_hello_request(payload, 1).value().protocol_minor, 0);
  assert_int_equal(status_of(2), static_cast<int>(BaseStatus::kTruncated));
  assert_int_equal(status_of(0), static_cast<int>(BaseStatus::kInvalidArgument));
  for (const int major : {0, 2, 255}) {
    payload[1] = static_cast<std::uint8_t>(major);
    assert_int_equal(status_of(2), static_cast<int>(BaseStatus::kBadVersion));
    assert_int_equal(status_of(3), static_cast<int>(BaseStatus::kBadVersion));
  }
  payload[0] = 0x40;
  assert_int_equal(status_of(3), static_cast<int>(BaseStatus::kInvalidArgument));
}

TEST(text_is_as_specified) {
  check_contract(sample_text(), spec_bytes("Text: t 5, warning"), encode_text, decode_text);
}

TEST(resend_request_is_as_specified) {
  check_contract(sample_resend_request(), spec_bytes("Resend request: tag `1234`"),
                 encode_resend_request, decode_resend_request);
  const Bytes bytes = encoded(sample_resend_request(), encode_resend_request);
  const ResendRequest request = decode_resend_request(bytes.data(), bytes.size()).value();
  assert_int_equal(request.ranges[1].first, 2);
  assert_int_equal(request.ranges[1].count, 10);
  assert_int_equal(request.ranges[2].first, 1000);
}

TEST(schema_text_stands_in_the_specification) {
  assert_string_equal(schema_text(), spec_block("# Schema\n").c_str());
  assert_int_equal(schema_hash(), 0x074932F3);
}

TEST(largest_messages_fit_their_bounds) {
  Bytes bytes(kMaxPayload_bytes);
  Hello hello = sample_hello();
  hello.table_count = kMaxHelloTables;
  const std::string longest(kMaxHelloText_bytes, 'x');
  name_survey(hello, longest.c_str(), longest.c_str(), kMaxPayload_bytes);
  auto size = encode_hello(hello, bytes.data(), kMaxHello_bytes);
  assert_true(size.ok());
  assert_int_equal(size.value(), kMaxHello_bytes);
  Status status = sample_status();
  status.port_count = kMaxStatusPorts;
  std::uint32_t* const first = &status.work_last_voxels;
  for (std::uint32_t* number = first; number <= &status.recorder_lost; ++number) {
    *number = 0xFFFFFFFF;
  }
  for (PortStatus& port : status.ports) {
    port = {1, 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF};
  }
  status.swath = {2, {{255, -64, UINT16_MAX}, {255, 64, UINT16_MAX}}};
  size = encode_status(status, bytes.data(), kMaxStatus_bytes);
  assert_true(size.ok());
  assert_int_equal(size.value(), 398);
  ResendRequest request{};
  request.range_count = kMaxResendRanges;
  for (std::uint32_t i = 0; i < kMaxResendRanges; ++i) {
    request.ranges[i] = {i * 200'000, 150'000};
  }
  size = encode_resend_request(request, bytes.data(), kMaxResendRequest_bytes);
  assert_true(size.ok());
}

/// Both directions refuse the same: the encoder the struct, the decoder its bytes.
template <typename Message, typename Encode>
void refused(const Message& message, Encode encode) {
  Bytes room(kMaxPayload_bytes);
  assert_int_equal(static_cast<int>(encode(message, room.data(), room.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

template <typename Decode>
void refused_bytes(Bytes bytes, std::size_t at, std::uint8_t value, BaseStatus status,
                   Decode decode) {
  bytes[at] = value;
  assert_int_equal(static_cast<int>(decode(bytes.data(), bytes.size()).status()),
                   static_cast<int>(status));
}

TEST(hello_fields_out_of_range_are_refused) {
  const auto with = [](auto change) {
    Hello hello = sample_hello();
    change(hello);
    return hello;
  };
  refused(with([](Hello& h) { h.protocol_major = 2; }), encode_hello);
  refused(with([](Hello& h) { h.tile_side_cells = 32; }), encode_hello);
  refused(with([](Hello& h) { h.table_count = 9; }), encode_hello);
  refused(with([](Hello& h) { h.cell_mm = 0; }), encode_hello);
  refused(with([](Hello& h) { h.cell_mm = 1'000'001; }), encode_hello);
  refused(with([](Hello& h) { h.size_cells[0] = 16'001; }), encode_hello);
  refused(with([](Hello& h) { h.size_cells[1] = 0; }), encode_hello);
  refused(with([](Hello& h) { h.size_cells[2] = 2049; }), encode_hello);
  refused(with([](Hello& h) { h.origin_mm[1] = (1LL << 40U) + 1; }), encode_hello);
  refused(with([](Hello& h) { h.latitude_e9deg = 90'000'000'001; }), encode_hello);
  refused(with([](Hello& h) { h.longitude_e9deg = -180'000'000'001; }), encode_hello);
  refused(with([](Hello& h) { h.has_geodetic_origin = 2; }), encode_hello);
  refused(with([](Hello& h) { h.epsg = -1; }), encode_hello);
  refused(with([](Hello& h) { h.survey_name.size_bytes = 65; }), encode_hello);
  refused(with([](Hello& h) { h.survey_name.text[0] = '\n'; }), encode_hello);
  refused(with([](Hello& h) { h.vertical_datum.text[2] = '\xC3'; }), encode_hello);

  const Bytes bytes = encoded(sample_hello(), encode_hello);
  refused_bytes(bytes, 1, 2, BaseStatus::kBadVersion, decode_hello);
  refused_bytes(bytes, 3, 32, BaseStatus::kOutOfRange, decode_hello);
  refused_bytes(bytes, 27, 0x80, BaseStatus::kOutOfRange, decode_hello);  // cell_mm < 0
  refused_bytes(bytes, 85, 9, BaseStatus::kOutOfRange, decode_hello);     // table_count
  refused_bytes(bytes, 94, 65, BaseStatus::kOutOfRange, decode_hello);    // size of the name
  refused_bytes(bytes, 95, 0x7F, BaseStatus::kOutOfRange, decode_hello);
  refused_bytes(bytes, 108, 9, BaseStatus::kTruncated, decode_hello);  // size of the datum
  // A newer minor of the same major is a peer.
  Bytes newer = bytes;
  newer[2] = 9;
  assert_true(decode_hello(newer.data(), newer.size()).ok());
}

TEST(status_fields_out_of_range_are_refused) {
  Status status = sample_status();
  status.port_count = 9;
  refused(status, encode_status);
  status = sample_status();
  status.pose_validity = 8;
  refused(status, encode_status);
  status = sample_status();
  status.ports[1].state = 2;
  refused(status, encode_status);
  const Bytes bytes = encoded(sample_status(), encode_status);
  refused_bytes(bytes, 25, 8, BaseStatus::kOutOfRange, decode_status);
  // A varint that is not the shortest, and one beyond 32 bits.
  Bytes longer = bytes;
  longer[58] = 0xE8 | 0x80U;
  longer[59] = 0x80;
  longer.insert(longer.begin() + 60, 0x00);
  assert_int_equal(static_cast<int>(decode_status(longer.data(), longer.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  for (const int last : {0x1F, 0x80}) {
    Bytes wide(bytes.begin(), bytes.begin() + 58);
    wide.insert(wide.end(), {0xFF, 0xFF, 0xFF, 0xFF, static_cast<std::uint8_t>(last)});
    wide.insert(wide.end(), 80, 0);
    assert_int_equal(static_cast<int>(decode_status(wide.data(), wide.size()).status()),
                     static_cast<int>(BaseStatus::kOutOfRange));
  }
  // More ports than there are is refused, not read.
  Bytes many(bytes.begin(), bytes.begin() + 58);
  many.insert(many.end(), 32, 0);
  many.push_back(200);
  many.insert(many.end(), 2000, 0);
  assert_int_equal(static_cast<int>(decode_status(many.data(), many.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(brief_fields_out_of_range_are_refused) {
  Brief brief = brief_of(sample_status());
  brief.pose_validity = 8;
  refused(brief, encode_brief);
  brief = brief_of(sample_status());
  brief.position_cm[2] = 214'748'365;
  refused(brief, encode_brief);
  const Bytes bytes = encoded(brief_of(sample_status()), encode_brief);
  refused_bytes(bytes, 6, 8, BaseStatus::kOutOfRange, decode_brief);
  // A range that 16 bits do not hold is refused, not cut.
  brief = brief_of(sample_status());
  brief.swath.beam_count = 1;
  brief.swath.beams[0] = {1, 2, 5};
  Bytes far = encoded(brief, encode_brief);
  far.back() = 0xFF;
  far.insert(far.end(), {0xFF, 0x03});
  assert_int_equal(decode_brief(far.data(), far.size()).value().swath.beams[0].range_dm, 65'535);
  far[far.size() - 3] = far[far.size() - 2] = 0x80;
  far.back() = 0x04;
  assert_int_equal(static_cast<int>(decode_brief(far.data(), far.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(text_takes_clean_utf8_only) {
  const auto status_of = [](const std::string& raw) {
    Bytes bytes = {0x04, 0, 0, 0, 0, 0, 0, 0, 0, 0, static_cast<std::uint8_t>(raw.size())};
    bytes.insert(bytes.end(), raw.begin(), raw.end());
    return static_cast<int>(decode_text(bytes.data(), bytes.size()).status());
  };
  const int bad = static_cast<int>(BaseStatus::kOutOfRange);
  for (const char* good : {"", "plain ~", "\xC2\xA0", "\xDF\xBF", "\xE0\xA0\x80", "\xEF\xBF\xBF",
                           "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF", "\xED\x9F\xBF"}) {
    assert_int_equal(status_of(good), static_cast<int>(BaseStatus::kOk));
  }
  for (const char* text :
       {"\x80", "\xC0\xAF", "\xC1\xBF", "\xC3", "\xC3(", "\xE0\x9F\xBF", "\xE2\x82", "\xED\xA0\x80",
        "\xF0\x8F\xBF\xBF", "\xF4\x90\x80\x80", "\xF8\x88\x80\x80\x80", "\xFF", "tab\t", "\x1B[0m",
        "\x7F", "\xC2\x85", "line\n"}) {
    assert_int_equal(status_of(text), bad);
  }
  assert_int_equal(status_of(std::string("a\0b", 3)), bad);
  assert_int_equal(status_of(std::string(201, 'a')), bad);
  assert_int_equal(status_of(std::string(200, 'a')), static_cast<int>(BaseStatus::kOk));
  Text text = sample_text();
  text.severity = static_cast<Severity>(3);
  refused(text, encode_text);
  text = sample_text();
  text.size_bytes = 201;
  refused(text, encode_text);
}

TEST(make_text_cuts_between_characters) {
  std::string line(199, 'x');
  line += "\xC3\xBC!";
  const Text cut = make_text(7, Severity::kError, line.c_str());
  assert_int_equal(cut.size_bytes, 199);
  assert_true(cut.t_us == 7);
  assert_int_equal(make_text(0, Severity::kInfo, nullptr).size_bytes, 0);
  assert_int_equal(make_text(0, Severity::kInfo, "up to\there").size_bytes, 5);
  assert_int_equal(make_text(0, Severity::kInfo, std::string(500, 'y').c_str()).size_bytes, 200);
}

TEST(resend_ranges_ascend_and_stay_apart) {
  const auto with = [](TileRange a, TileRange b) {
    ResendRequest request{};
    request.range_count = 2;
    request.ranges[0] = a;
    request.ranges[1] = b;
    return request;
  };
  refused(with({0, 0}, {5, 1}), encode_resend_request);
  refused(with({0, 5}, {5, 1}), encode_resend_request);  // touch
  refused(with({9, 1}, {5, 1}), encode_resend_request);
  refused(with({0, 1}, {1U << 24U, 1}), encode_resend_request);
  refused(with({0, 1}, {2, 1U << 24U}), encode_resend_request);
  ResendRequest many{};
  many.range_count = 65;
  refused(many, encode_resend_request);
  const auto status_of = [](const Bytes& bytes) {
    return static_cast<int>(decode_resend_request(bytes.data(), bytes.size()).status());
  };
  assert_int_equal(status_of({0x40, 0, 0, 65}), static_cast<int>(BaseStatus::kOutOfRange));
  // Beyond the last tile, by the gap, by the count, and by a sum that would wrap.
  assert_int_equal(status_of({0x40, 0, 0, 1, 0x80, 0x80, 0x80, 0x08, 0}),
                   static_cast<int>(BaseStatus::kOutOfRange));
  assert_int_equal(status_of({0x40, 0, 0, 1, 0, 0x80, 0x80, 0x80, 0x08}),
                   static_cast<int>(BaseStatus::kOutOfRange));
  assert_int_equal(status_of({0x40, 0, 0, 1, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0x0A}),
                   static_cast<int>(BaseStatus::kOutOfRange));
  // The whole map.
  ResendRequest whole{};
  whole.range_count = 1;
  whole.ranges[0] = {0, 1U << 24U};
  const Bytes bytes = encoded(whole, encode_resend_request);
  assert_int_equal(decode_resend_request(bytes.data(), bytes.size()).value().ranges[0].count,
                   1U << 24U);
}

TEST(types_are_known_or_skipped) {
  int known = 0;
  for (int byte = 0; byte < 256; ++byte) {
    const auto payload = static_cast<std::uint8_t>(byte);
    MessageType type{};
    const bool is_known = message_type(&payload, 1, type);
    known += is_known ? 1 : 0;
    assert_true(!is_known || static_cast<int>(type) == byte);
  }
  assert_int_equal(known, 23);
  MessageType type{};
  assert_false(message_type(nullptr, 0, type));
}

TEST(random_messages_survive_the_round) {
  Random random;
  for (int i = 0; i < 20'000; ++i) {
    Status status = sample_status();
    status.t_us = static_cast<std::int64_t>(random.next());
    status.position_mm[0] = static_cast<std::int32_t>(random.next());
    for (std::uint32_t& count : status.pings) {
      count = static_cast<std::uint32_t>(random.next() >> random.between(32, 63));
    }
    const Bytes bytes = encoded(status, encode_status);
    const auto back = decode_status(bytes.data(), bytes.size());
    assert_true(back.ok() && back.value().t_us == status.t_us);
    assert_memory_equal(back.value().pings, status.pings, sizeof status.pings);
    // A changed byte is refused or decodes to something that encodes to the same bytes.
    Bytes bad = bytes;
    bad[static_cast<std::size_t>(random.between(1, static_cast<std::int64_t>(bad.size()) - 1))] =
        static_cast<std::uint8_t>(random.next());
    const auto changed = decode_status(bad.data(), bad.size());
    if (changed.ok()) {
      const Bytes again = encoded(changed.value(), encode_status);
      assert_true(again.size() <= bad.size());
      assert_memory_equal(again.data(), bad.data(), again.size());
    }
  }
}

/// The k-th line of the block behind `mark`.
Bytes spec_line(const std::string& mark, std::size_t k) {
  std::string block = leadline::test::spec_block(mark);
  for (; k > 0; --k) {
    block.erase(0, block.find('\n') + 1);
  }
  return leadline::test::from_hex(block.substr(0, block.find('\n') + 1));
}

TEST(a_report_is_as_specified) {
  Report report{};
  report.survey_tag = 0x1234;
  report.asked = true;
  report.newest = 0x0203;
  report.mask_bytes = 2;
  report.mask[0] = 0x0D;
  report.mask[1] = 0x80;
  check_contract(report, spec_line("Report: tag `1234`", 0), encode_report, decode_report);
  for (const std::uint32_t before : {0U, 2U, 3U, 15U}) {
    assert_true(report.came(before));
  }
  assert_false(report.came(1) || report.came(14));
  check_contract(Question{0x1234, 0x0203}, spec_line("Report: tag `1234`", 1), encode_question,
                 decode_question);
  report.mask_bytes = kMaxReportMask_bytes + 1;
  std::uint8_t room[512];
  assert_int_equal(static_cast<int>(encode_report(report, room, sizeof room).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  const Bytes many = {0x42, 0, 0, 33};
  assert_int_equal(static_cast<int>(decode_report(many.data(), many.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
}

TEST(digests_and_their_requests_are_as_specified) {
  Digest digest{};
  digest.survey_tag = 0x1234;
  digest.first = 300;
  digest.tiles_log2 = 2;
  digest.hash_count = 2;
  digest.hashes[0] = 0x01020304;
  digest.hashes[1] = 0xFFFFFFFE;
  check_contract(digest, spec_bytes("Digest: tag `1234`"), encode_digest, decode_digest);
  std::uint8_t room[512];
  const auto refused = [&room](const Digest& wrong) {
    return encode_digest(wrong, room, sizeof room).status() == BaseStatus::kOutOfRange;
  };
  Digest wrong = digest;
  wrong.hash_count = 0;
  assert_true(refused(wrong));
  wrong.hash_count = kMaxDigestHashes + 1;
  assert_true(refused(wrong));
  wrong = digest;
  wrong.tiles_log2 = kMaxDigestLog2 + 1;
  assert_true(refused(wrong));
  wrong = digest;
  wrong.first = kMaxTiles;
  assert_true(refused(wrong));

  check_contract(DigestRequest{0x1234, {300, 64}}, spec_line("Digest request: tag `1234`", 0),
                 encode_digest_request, decode_digest_request);
  const Bytes beyond = {0x43, 0, 0, 0xFF, 0xFF, 0xFF, 0x07, 1};  // 2^24 - 1 and one more
  assert_int_equal(static_cast<int>(decode_digest_request(beyond.data(), beyond.size()).status()),
                   static_cast<int>(BaseStatus::kOutOfRange));
  check_contract(Look{0x1234, 300, 2}, spec_line("Digest request: tag `1234`", 1), encode_look,
                 decode_look);
}

}  // namespace
