#include "model/base/crc32c.hpp"
#include "proto/messages.hpp"

namespace leadline::proto {
namespace {

// The text that proto/SPEC.md shows under "Schema": a test compares the two byte for byte. Lines end with
// \n, the last one too.
constexpr char kSchema[] =
#include "proto/schema_text.inc"
    ;

}  // namespace

const char* schema_text() { return kSchema; }

std::uint32_t schema_hash() { return base::crc32c(kSchema, sizeof kSchema - 1); }

}  // namespace leadline::proto
