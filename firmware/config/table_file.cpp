#include "firmware/config/table_file.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/input_file.hpp"
#include "model/base/status.hpp"

namespace leadline::host {
namespace {

using model::LocalizationTable;

std::string hex(std::uint32_t value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "0x%08x", value);
  return text.data();
}

}  // namespace

LocalizationTable load_table(const std::string& path) {
  std::ifstream file = open_input(path);
  // One byte more than a table has tells a file that is too long, whatever its size claims to be.
  std::string bytes(sizeof(LocalizationTable) + 1, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  if (file.bad()) {
    throw HostError(ExitCode::kInput, path + ": cannot be read to its end");
  }
  return parse_table(bytes, path);
}

LocalizationTable parse_table(std::string_view bytes, const std::string& name) {
  // Into a table of its own first: the bytes may lie anywhere.
  LocalizationTable table{};
  const std::size_t taken = std::min(bytes.size(), sizeof(table));
  std::memcpy(&table, bytes.data(), taken);
  const std::string expected = std::to_string(sizeof(table));
  const base::Status status = bytes.size() > sizeof(table) && table.version == model::kTableVersion
                                  ? base::Status::kInvalidArgument
                                  : model::check_table(&table, taken);
  std::string reason;
  switch (status) {
    case base::Status::kOk:
      return table;
    case base::Status::kTruncated:
      reason = "truncated: " + std::to_string(bytes.size()) + " of " + expected + " bytes";
      break;
    case base::Status::kInvalidArgument:
      reason = "longer than the " + expected + " bytes of a table";
      break;
    case base::Status::kBadVersion:
      reason = "table version " + std::to_string(table.version) + ", this program reads version " +
               std::to_string(model::kTableVersion) + "; make it anew with `leadline table`";
      break;
    case base::Status::kBadChecksum:
      reason = "damaged: the checksum says " + hex(table.crc32c) + ", the bytes " +
               hex(model::table_crc(table));
      break;
    default:
      reason = table.magic == model::kTableMagic
                   ? "a value in it is outside its range; make it anew with `leadline table`"
                   : "not a localization table (it does not begin with LLT1)";
      break;
  }
  throw HostError(ExitCode::kInput, name + ": " + reason);
}

}  // namespace leadline::host
