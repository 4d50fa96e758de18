#include "firmware/linux/vehicle_loop.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <iostream>
#include <sstream>
#include <utility>

#include "firmware/config/exit_codes.hpp"
#include "firmware/linux/datagrams.hpp"
#include "firmware/linux/monotonic.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "proto/messages.hpp"

namespace leadline::host {
namespace {

constexpr int kConnect_ms = 10'000;
constexpr int kGrantSlice_ms = 100;               ///< how long an order to stop waits at most
constexpr std::int64_t kSilence_us = 60'000'000;  ///< of the emulator
constexpr std::int64_t kArrival_us = 10'000'000;  ///< of granted bytes
constexpr int kAnswer_ms = 10'000;
constexpr base::TimeUs kReportInterval_us = 1'000'000;
constexpr std::int64_t kFastDrain_us = 1000;
/// Room for the program's own chunks (but the store's) beside the shares of the sources.
constexpr std::size_t kOwnChunk_bytes = 384;
/// At the end: pages that are not yet saved may take so long; a store that fails gets drain_us.
constexpr std::int64_t kStoreDrain_us = 60'000'000;
static_assert(firmware::kMaxHostReport_bytes + 2 * firmware::kMaxCommandEvent_bytes <=
                  kOwnChunk_bytes,
              "a report, a command and a tally always find room");

void say(const std::string& what) {
  std::ostringstream line;  // one write: lines of two threads do not mix
  line << "leadline-vehicle: " << what << "\n";
  std::cerr << line.str();
}

std::size_t share_of(const VehicleFile& file) {
  const std::size_t store = file.config.has_store != 0 ? PageFile::kCycle_bytes : 0;
  return (firmware::kMaxCycleBytes - kOwnChunk_bytes - store) / (file.port_uris.size() + 1);
}

void sleep_until_ready(pollfd* waits, std::size_t count, std::int64_t left_us) {
  const timespec wait = {static_cast<std::time_t>(left_us / 1'000'000),
                         static_cast<long>(left_us % 1'000'000 * 1000)};
  if (::ppoll(waits, static_cast<nfds_t>(count), &wait, nullptr) <= 0) {
    for (std::size_t i = 0; i < count; ++i) {
      waits[i].revents = 0;
    }
  }
}

}  // namespace

VehicleLoop::VehicleLoop(const VehicleFile& file,
                         const std::vector<model::LocalizationTable>& tables,
                         firmware::Vehicle& vehicle, Recorder* recorder, PageFile* pages,
                         CommandPort* commands, const LoopOptions& options)
    : file_(file),
      tables_(tables),
      vehicle_(vehicle),
      recorder_(recorder),
      pages_(pages),
      commands_(commands),
      options_(options),
      chunks_(file.port_uris.size() + 1, share_of(file)),
      batch_(Recorder::kBatch_bytes) {
  const auto add = [&](const hal::UriSpec& spec, const std::string& name, hal::FileUse use,
                       bool optional) {
    const std::string problem = hal::device_problem(spec, use, optional);
    if (!problem.empty()) {
      throw HostError(ExitCode::kUsage, name + ": " + problem);
    }
    hal::PortResult made = hal::make_port(spec, use);
    if (!made.error.empty()) {
      throw HostError(ExitCode::kUsage, name + ": " + made.error);
    }
    Line line;
    line.port = std::move(made.port);
    line.uri = hal::uri_text(spec);
    line.name = name;
    lines_.push_back(std::move(line));
  };
  for (std::size_t i = 0; i < file.port_uris.size(); ++i) {
    add(file.port_uris[i], "port " + std::to_string(i), hal::FileUse::kRead, file.port_optional[i]);
  }
  add(file.link_uri, "link", hal::FileUse::kWrite, file.link_optional);
}

VehicleLoop::~VehicleLoop() = default;

std::uint8_t VehicleLoop::source_number(std::size_t index) const {
  return index == link_index() ? firmware::kUplinkPort : static_cast<std::uint8_t>(index);
}

// ---- Ports --------------------------------------------------------------------------------------

void VehicleLoop::service(base::TimeUs now_us) {
  for (Line& line : lines_) {
    line.port->service(now_us);
    const std::string change = line.watch.change(*line.port);
    if (!change.empty()) {
      say(line.name + " " + line.uri + ": " + change);
    }
  }
}

void VehicleLoop::take_line(std::size_t index, base::TimeUs now_us) {
  bool spoke = false;
  do {
    spoke = chunks_.read(port(index), index, source_number(index), now_us);
    link_spoke_ = link_spoke_ || (spoke && index == link_index());
  } while (spoke && port(index).held_bytes() > 0);
}

std::size_t VehicleLoop::wait_set(bool only_link) {
  std::size_t count = 0;
  for (std::size_t i = only_link ? link_index() : 0; i < lines_.size(); ++i) {
    hal::LinuxPort& line = port(i);
    if (line.poll_fd() >= 0 && chunks_.has_room(line, i)) {
      waits_[count] = {line.poll_fd(), line.poll_events(), 0};
      waiting_lines_[count] = i;
      count += 1;
    }
  }
  return count;
}

void VehicleLoop::gather(std::int64_t deadline_us, bool only_link,
                         const volatile std::sig_atomic_t& stop) {
  const std::sig_atomic_t stop_before = stop;
  // What the cycle before had no room for is not announced again.
  for (std::size_t i = only_link ? link_index() : 0; i < lines_.size(); ++i) {
    if (port(i).held_bytes() > 0) {
      take_line(i, monotonic_us());
    }
  }
  const std::int64_t soonest_us = cycle_begun_us_ + firmware::least_cycle_us(file_.cycle_us);
  const auto hasten = [this, &deadline_us, soonest_us](std::int64_t wish_us) {
    if (!lockstep()) {
      deadline_us = std::min(deadline_us, std::max(wish_us, soonest_us));
    }
  };
  hasten(wish_us_);
  for (std::int64_t now_us = monotonic_us(); now_us < deadline_us && stop == stop_before;
       now_us = monotonic_us()) {
    const std::size_t count = wait_set(only_link);
    sleep_until_ready(waits_.data(), count, deadline_us - now_us);
    const base::TimeUs arrival_us = monotonic_us();
    for (std::size_t i = 0; i < count; ++i) {
      if (waits_[i].revents == 0) {
        continue;
      }
      port(waiting_lines_[i]).service(arrival_us);
      take_line(waiting_lines_[i], arrival_us);
    }
    if (link_spoke_) {
      hasten(arrival_us);
    }
  }
  for (std::size_t i = only_link ? link_index() : 0; i < lines_.size(); ++i) {
    while (chunks_.read_rest(port(i), i, source_number(i), monotonic_us())) {
    }
  }
  // Files cannot be waited for: they are read once a cycle.
  for (std::size_t i = only_link ? link_index() : 0; i < lines_.size(); ++i) {
    if (port(i).poll_fd() < 0) {
      take_line(i, monotonic_us());
    }
  }
}

void VehicleLoop::take_granted(std::size_t index, base::TimeUs t_us, std::uint64_t total) {
  hal::LinuxPort& line = port(index);
  const std::int64_t start_us = monotonic_us();
  while (line.state() == hal::PortState::kOpen && line.counters().bytes_in < total &&
         chunks_.has_room(line, index)) {
    const auto missing = static_cast<std::size_t>(total - line.counters().bytes_in);
    if (chunks_.read(line, index, source_number(index), t_us, missing)) {
      continue;
    }
    if (monotonic_us() - start_us > kArrival_us) {
      throw HostError(ExitCode::kInput, lines_[index].name + " " + lines_[index].uri +
                                            ": the emulator granted " + std::to_string(total) +
                                            " bytes, " + std::to_string(line.counters().bytes_in) +
                                            " arrived");
    }
    pollfd wait = {line.poll_fd(), POLLIN, 0};
    sleep_until_ready(&wait, line.poll_fd() >= 0 ? 1 : 0, 10'000);
  }
}

void VehicleLoop::gather_granted(base::TimeUs t_us, const hal::LockstepCounts& granted) {
  for (std::size_t i = 0; i < link_index(); ++i) {
    take_granted(i, t_us, granted.bytes[i]);
  }
  while (chunks_.read(port(link_index()), link_index(), firmware::kUplinkPort, t_us)) {
    link_spoke_ = true;
  }
}

hal::LockstepCounts VehicleLoop::requested() const {
  hal::LockstepCounts counts;
  for (std::size_t i = 0; i < link_index(); ++i) {
    counts.bytes[i] = lines_[i].port->counters().bytes_out;
  }
  counts.bytes[hal::kLockstepLink] = lines_.back().port->counters().bytes_out;
  return counts;
}

// ---- One cycle ----------------------------------------------------------------------------------

firmware::HostReport VehicleLoop::host_report() const {
  firmware::HostReport report{};
  report.port_count = static_cast<std::uint8_t>(link_index());
  for (std::size_t i = 0; i < link_index(); ++i) {
    const hal::LinuxPort& line = *lines_[i].port;
    const bool open = line.state() == hal::PortState::kOpen;
    report.port_open[i] = open ? 1 : 0;
    report.dropped_bytes[i] = static_cast<std::uint32_t>(line.counters().bytes_dropped_in +
                                                         line.counters().bytes_dropped_out);
    report.opens[i] = static_cast<std::uint16_t>(line.counters().opens);
    report.errors[i] = open ? std::uint16_t{0} : static_cast<std::uint16_t>(line.last_errno());
    report.alarms |= open ? 0U : std::uint32_t{proto::kAlarmPortLost};
  }
  if (recorder_ != nullptr) {
    const RecorderReport recorded = recorder_->report();
    report.recorder_lost = recorded.records_lost;
    const bool losing = recorded.failing || recorded.records_lost != reported_.recorder_lost;
    report.alarms |= losing ? std::uint32_t{proto::kAlarmRecorderLost} : 0U;
  }
  if (!lockstep()) {  // a virtual clock measures nothing, and its runs repeat
    report.cycle_last_us = static_cast<std::uint32_t>(cycle_last_us_);
    report.cycle_max_us = static_cast<std::uint32_t>(summary_.cycle_max_us);
  }
  return report;
}

void VehicleLoop::add_host_report(base::TimeUs t_us) {
  const firmware::HostReport report = host_report();
  const auto differs = [](const auto& now, const auto& before) {
    return !std::equal(std::begin(now), std::end(now), std::begin(before));
  };
  const bool changed = !ever_reported_ || report.alarms != reported_.alarms ||
                       differs(report.port_open, reported_.port_open) ||
                       differs(report.opens, reported_.opens) ||
                       differs(report.errors, reported_.errors);
  if (!changed && t_us < report_due_us_) {
    return;
  }
  std::array<std::uint8_t, firmware::kMaxHostReport_bytes> bytes{};
  const std::size_t size = firmware::encode_host_report(report, bytes.data(), bytes.size());
  if (chunks_.add(firmware::kHostPort, t_us, bytes.data(), size)) {
    reported_ = report;
    ever_reported_ = true;
    report_due_us_ = t_us + kReportInterval_us;
  }
}

std::uint32_t VehicleLoop::downlink_room() const {
  const std::size_t room = lines_.back().port->write_room();
  return static_cast<std::uint32_t>(std::min(room, firmware::kDownlinkCapacity_bytes));
}

// All of the uplink first: adding moves nothing, but what is added is not the uplink's.
void VehicleLoop::hear_commands(base::TimeUs t_us) {
  const std::size_t count = chunks_.chunk_count();
  for (std::size_t i = 0; i < count; ++i) {
    const firmware::InputChunk& chunk = chunks_.chunks()[i];
    if (chunk.port == firmware::kUplinkPort) {
      commands_->hear(chunk.data, chunk.size_bytes, t_us);
    }
  }
  commands_->take(t_us, &chunks_);
}

void VehicleLoop::run_cycle(base::TimeUs t_us) {
  const std::int64_t start_us = monotonic_us();
  cycle_begun_us_ = start_us;
  add_host_report(t_us);
  if (pages_ != nullptr) {
    if (lockstep()) {
      pages_->wait_answered();
    }
    pages_->take(t_us, &chunks_);
  }
  if (commands_ != nullptr) {
    hear_commands(t_us);
  }
  const firmware::CycleInput input = {t_us, chunks_.chunks(), chunks_.chunk_count(),
                                      downlink_room()};
  firmware::CycleOutput output{};
  // From here until the frames are handed to the link nothing asks the kernel (tests/cli/test_timing_ci.py).
  vehicle_.cycle(input, output);
  send(output);
  wish_us_ = output.wish_us == 0 ? INT64_MAX : start_us + output.wish_us;
  timing_.cycle.add(monotonic_us() - start_us);
  if (pages_ != nullptr) {
    pages_->ask(output.store);
  }
  record(input, output);
  chunks_.clear();
  summary_.cycles += 1;
  summary_.t_us = t_us;
  cycle_last_us_ = monotonic_us() - start_us;
  summary_.cycle_max_us = std::max(summary_.cycle_max_us, cycle_last_us_);
  manager_.cycle_done(start_us + cycle_last_us_);
}

void VehicleLoop::send(const firmware::CycleOutput& output) {
  for (std::size_t i = 0; i < link_index() && !stopping_; ++i) {
    const firmware::OutputSpan& request = output.device_requests[i];
    if (request.size_bytes > 0) {
      (void)port(i).write(request.data, request.size_bytes);  // what is dropped is counted there
    }
  }
  hal::LinuxPort& link = port(link_index());
  const std::uint8_t* frames = output.downlink.data;
  std::size_t left = output.downlink.size_bytes;
  while (left > 0) {
    const std::size_t size =
        link.datagrams() ? next_datagram_bytes(frames, left, file_.config.link.mtu_bytes) : left;
    (void)link.write(frames, size);
    frames += size;
    left -= size;
  }
}

// ---- Log ----------------------------------------------------------------------------------------

void VehicleLoop::begin_log(base::TimeUs t_us) {
  if (recorder_ == nullptr) {
    return;
  }
  std::vector<firmware::TableBlock> blocks;
  for (const model::LocalizationTable& table : tables_) {
    blocks.push_back({&table, sizeof table});
  }
  proto::LogWriter writer(batch_.data(), batch_.size());
  const base::Status status = firmware::log_begin(writer, vehicle_.config(), blocks.data(),
                                                  blocks.size(), t_us, lockstep() ? 0 : utc_us());
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kInternal,
                    std::string("the log's header: ") + base::status_text(status));
  }
  for (int copy = 0; copy < firmware::kLogPreambleCopies; ++copy) {
    (void)recorder_->push(t_us, writer.data(), writer.size_bytes(), 3);
  }
}

void VehicleLoop::record(const firmware::CycleInput& input, const firmware::CycleOutput& output) {
  if (recorder_ == nullptr) {
    return;
  }
  proto::LogWriter writer(batch_.data(), batch_.size());
  // A batch has room for the most that a cycle can hold; chunks are within their limit.
  (void)firmware::log_cycle(writer, static_cast<std::uint32_t>(summary_.cycles), input, output);
  const auto records = static_cast<std::uint32_t>(input.chunk_count + 1);
  (void)recorder_->push(input.t_us, writer.data(), writer.size_bytes(), records);
}

void VehicleLoop::end_log() {
  if (recorder_ == nullptr) {
    return;
  }
  proto::LogWriter writer(batch_.data(), batch_.size());
  if (writer.end(firmware::log_end_of(vehicle_, summary_.t_us)) == base::Status::kOk) {
    (void)recorder_->push(summary_.t_us, writer.data(), writer.size_bytes(), 1);
  }
}

// ---- The run ------------------------------------------------------------------------------------

void VehicleLoop::fly_real(const volatile std::sig_atomic_t& stop) {
  std::int64_t next_us = monotonic_us();
  begin_log(next_us);
  next_us += file_.cycle_us;
  while (stop == 0) {
    service(monotonic_us());
    link_spoke_ = false;
    gather(next_us, false, stop);
    const base::TimeUs now_us = monotonic_us();
    const bool early = now_us < next_us;
    if (early && stop == 0) {
      run_cycle(now_us);
      continue;
    }
    timing_.slip.add(now_us - next_us);
    run_cycle(now_us);
    const std::int64_t late_us = monotonic_us() - next_us;
    if (late_us >= file_.cycle_us) {
      summary_.overruns += 1;
      next_us += late_us;
    }
    next_us += file_.cycle_us;
  }
}

void VehicleLoop::fly_lockstep(const volatile std::sig_atomic_t& stop) {
  bool begun = false;
  std::int64_t heard_us = monotonic_us();
  while (stop == 0) {
    base::TimeUs t_us = 0;
    hal::LockstepCounts granted;
    hal::LockstepStatus status = clock_.wait_grant(t_us, granted, kGrantSlice_ms);
    if (status == hal::LockstepStatus::kTimeout && monotonic_us() - heard_us < kSilence_us) {
      continue;
    }
    if (status == hal::LockstepStatus::kFinished) {
      return;
    }
    if (status == hal::LockstepStatus::kOk) {
      if (!begun) {
        begin_log(t_us);
        begun = true;
      }
      service(t_us);
      gather_granted(t_us, granted);
      run_cycle(t_us);
      heard_us = monotonic_us();
      status = clock_.answer(t_us, requested(), kAnswer_ms);
    }
    if (status != hal::LockstepStatus::kOk) {
      throw HostError(ExitCode::kInput, "lockstep:" + options_.lockstep_path + ": " +
                                            hal::lockstep_status_text(status));
    }
  }
}

void VehicleLoop::drain(const volatile std::sig_atomic_t& stop) {
  stopping_ = true;
  const base::TimeUs begin_us = lockstep() ? summary_.t_us : monotonic_us();
  std::int64_t quiet_us = monotonic_us();
  const std::int64_t real_begin_us = quiet_us;
  const std::sig_atomic_t stop_before = stop;
  while (stop == stop_before) {
    // Virtual time need not wait for the link's rate; the topside's questions take real time.
    const bool fast = lockstep() && !summary_.drained;
    const std::int64_t start_us = monotonic_us();
    link_spoke_ = false;
    port(link_index()).service(lockstep() ? summary_.t_us : start_us);
    gather(start_us + (fast ? kFastDrain_us : file_.cycle_us), true, stop);
    // What came up the link has its arrival on the real clock; the virtual one counts cycles.
    const base::TimeUs t_us = lockstep() ? summary_.t_us + file_.cycle_us : monotonic_us();
    if (lockstep()) {
      chunks_.retime(t_us);
    }
    quiet_us = link_spoke_ ? monotonic_us() : quiet_us;
    run_cycle(t_us);
    summary_.drained = vehicle_.drained() && port(link_index()).pending_out_bytes() == 0;
    const bool given_up =
        t_us - begin_us >= options_.drain_us + (summary_.drained ? options_.linger_us : 0);
    if (pages_ != nullptr && !finish_said_ && (summary_.drained || given_up)) {
      finish_said_ = true;
      pages_->finish();
    }
    summary_.stored = pages_ == nullptr || (finish_said_ && vehicle_.stored());
    const bool store_given_up =
        monotonic_us() - real_begin_us >=
        options_.drain_us + (vehicle_.pager().failing() ? options_.drain_us : kStoreDrain_us);
    if (!summary_.stored && !store_given_up) {
      continue;
    }
    if (summary_.drained && monotonic_us() - quiet_us >= options_.linger_us) {
      return;
    }
    if (given_up) {
      return;
    }
  }
}

LoopSummary VehicleLoop::run(const volatile std::sig_atomic_t& stop) {
  if (lockstep() && !clock_.connect(options_.lockstep_path, kConnect_ms)) {
    throw HostError(ExitCode::kInput, "lockstep:" + clock_.error());
  }
  try {
    lockstep() ? fly_lockstep(stop) : fly_real(stop);
    manager_.stopping();
    drain(stop);
  } catch (const HostError&) {
    end_log();
    throw;
  }
  end_log();
  return summary_;
}

}  // namespace leadline::host
