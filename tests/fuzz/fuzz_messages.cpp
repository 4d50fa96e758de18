// Payloads of any kind: a decoder never reads outside them, and what it takes encodes to the same bytes.
#include <array>
#include <cstdint>
#include <cstring>

#include "proto/framing.hpp"
#include "proto/log.hpp"
#include "proto/messages.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;

using namespace leadline::proto;  // NOLINT: every name of the headers is under test

std::array<std::uint8_t, kMaxPayload_bytes> again;

/// `decoded` was taken: encoding it gives the first bytes of the payload.
template <typename Message, typename Encode>
void check(const leadline::base::Result<Message>& decoded, const std::uint8_t* payload,
           std::size_t size, Encode encode) {
  if (!decoded.ok()) {
    return;
  }
  const auto encoded = encode(decoded.value(), again.data(), again.size());
  require(encoded.ok() && encoded.value() <= size);
  require(std::memcmp(again.data(), payload, encoded.value()) == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  MessageType type{};
  const bool known = message_type(data, size, type);
  require(!known || static_cast<std::uint8_t>(type) == data[0]);
  size = size < kMaxPayload_bytes ? size : kMaxPayload_bytes;
  check(decode_hello(data, size), data, size, encode_hello);
  check(decode_status(data, size), data, size, encode_status);
  check(decode_brief(data, size), data, size, encode_brief);
  check(decode_text(data, size), data, size, encode_text);
  check(decode_resend_request(data, size), data, size, encode_resend_request);
  const auto request = decode_hello_request(data, size);
  require(!request.ok() || (data[0] == 0x41 && request.value().protocol_major == kProtocolMajor));
  check(decode_digest(data, size), data, size, encode_digest);
  check(decode_report(data, size), data, size, encode_report);
  check(decode_question(data, size), data, size, encode_question);
  check(decode_digest_request(data, size), data, size, encode_digest_request);
  check(decode_look(data, size), data, size, encode_look);
  check(decode_log_header(data, size), data, size, encode_log_header);
  check(decode_log_chunk(data, size), data, size, encode_log_chunk);
  check(decode_log_cycle(data, size), data, size, encode_log_cycle);
  check(decode_log_gap(data, size), data, size, encode_log_gap);
  check(decode_log_end(data, size), data, size, encode_log_end);
  check(decode_log_piece(data, size), data, size,
        [type](const LogPiece& piece, std::uint8_t* out, std::size_t capacity) {
          return encode_log_piece(type, piece, out, capacity);
        });
  return 0;
}
