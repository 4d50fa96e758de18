#include "host_tools/topside/flight_log.hpp"

#include <filesystem>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

using firmware::LogEvent;
using firmware::LogRefusal;

constexpr std::size_t kBuffer_bytes = 65536;

[[noreturn]] void refuse_file(const std::string& path, const std::string& what) {
  throw HostError(ExitCode::kInput, path + ": " + what);
}

}  // namespace

FlightLog::FlightLog(const std::string& path)
    : path_(path),
      file_(open_input(path)),
      buffer_(kBuffer_bytes),
      player_(std::make_unique<firmware::LogPlayer>()) {
  std::error_code error;
  size_bytes_ = std::filesystem::file_size(path, error);
  if (error) {
    size_bytes_ = 0;  // a pipe: length not known
  }
  (void)next_event();  // kConfigured, or it throws
  for (std::size_t k = 0; k < player_->table_count(); ++k) {
    const firmware::TableBlock& table = player_->tables()[k];
    const auto* const bytes = static_cast<const std::uint8_t*>(table.bytes);
    tables_.emplace_back(bytes, bytes + table.size_bytes);
  }
}

LogEvent FlightLog::next_event() {
  for (;;) {
    while (begin_ < filled_) {
      std::size_t used = 0;
      const auto* const data = reinterpret_cast<const std::uint8_t*>(buffer_.data()) + begin_;
      const LogEvent event = player_->feed(data, filled_ - begin_, used);
      begin_ += used;
      if (event == LogEvent::kRefused) {
        refuse();
      }
      if (event != LogEvent::kMore) {
        return event;
      }
    }
    file_.read(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    filled_ = static_cast<std::size_t>(file_.gcount());
    begin_ = 0;
    read_bytes_ += filled_;
    if (filled_ == 0) {
      if (file_.bad()) {
        refuse_file(path_, "cannot be read to its end");
      }
      const LogEvent event = player_->finish();
      if (event == LogEvent::kRefused) {
        refuse();
      }
      return event;
    }
  }
}

void FlightLog::refuse() const {
  const LogRefusal refusal = player_->refusal();
  std::string what = firmware::log_refusal_text(refusal);
  if (refusal == LogRefusal::kTableDamaged) {
    what += " (table " + std::to_string(player_->refused_table()) + ")";
  } else if (refusal == LogRefusal::kHeader || refusal == LogRefusal::kConfigBad) {
    what += std::string(": ") + base::status_text(player_->refusal_status());
  }
  refuse_file(path_, what);
}

bool FlightLog::next(FlightCycle* cycle) {
  if (next_event() != LogEvent::kCycle) {
    return false;
  }
  cycle->number = player_->cycle_number();
  cycle->input = player_->input();
  cycle->whole = player_->cycle_whole();
  return true;
}

}  // namespace leadline::host
