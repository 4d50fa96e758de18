#include "host_tools/decode/decode.hpp"

#include <iostream>
#include <memory>

#include "host_tools/decode/decoder.hpp"
#include "host_tools/decode/record_json.hpp"
#include "host_tools/exit_codes.hpp"

namespace leadline::host {

using firmware::Driver;
using nlohmann::ordered_json;

void decode_recording(Recording* recording, Driver driver, bool json,
                      const std::function<void(const std::string&)>& out) {
  Decoder decoder(driver, [json, &out](const ordered_json& record) {
    out(json ? record.dump() : record_text(record));
  });
  RecordedBytes piece;
  while (recording->next(&piece)) {
    decoder.feed(piece.bytes.data(), piece.bytes.size(), piece.t_us);
  }
  decoder.finish();
  ordered_json summary = decoder.summary(recording->container());
  for (const auto& [reason, count] : recording->rejected()) {
    summary["rejected"][reason] = count;
  }
  if (json) {
    out(summary.dump());
    return;
  }
  out(std::to_string(summary["frames"].get<std::uint64_t>()) + " frames, " +
      std::to_string(summary["records"].get<std::uint64_t>()) + " records (" +
      recording->container() + "); rejected " + summary["rejected"].dump() + ", skipped " +
      summary["skipped_bytes"].dump() + " of " + summary["bytes"].dump() + " bytes");
}

int run_decode(const DecodeOptions& options) {
  const Driver driver = driver_named(options.driver, "decode: --driver");
  const std::unique_ptr<Recording> recording = open_recording(ByteSource(options.path), driver);
  decode_recording(recording.get(), driver, options.json,
                   [](const std::string& line) { std::cout << line << '\n'; });
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
