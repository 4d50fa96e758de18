#include "host_tools/emulate/emulate_command.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include <poll.h>

#include "hal/linux/linux_port.hpp"
#include "hal/linux/lockstep.hpp"
#include "hal/linux/pty_pair.hpp"
#include "hal/linux/uri.hpp"
#include "host_tools/emulate/fleet.hpp"
#include "host_tools/emulate/vehicle_config.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/options.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/stop_signals.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Devices run in steps of this; what left them within one arrives at its end.
constexpr base::TimeUs kStep_us = 1'000;
// Lockstep: an instant is granted this often. The vehicle runs one cycle each.
constexpr base::TimeUs kGrant_us = 20'000;
// Pause of the loops that wait for the other end.
constexpr int kPoll_ms = 20;

base::TimeUs monotonic_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch())
      .count();
}

struct UdpBase {
  std::string host;
  unsigned port = 0;
};

UdpBase parse_udp(const std::string& text) {
  const hal::UriResult uri = hal::parse_uri("udp:" + text);
  if (!uri.ok()) {
    usage_error("--udp " + printable(text) + ": " + uri.error);
  }
  return {uri.spec.host, uri.spec.port};
}

/// Where the vehicle finds the devices, by transport.
std::vector<std::string> vehicle_uris(const Mission& mission, const EmulateOptions& options) {
  const std::vector<std::string> names = fleet_ports(mission);
  std::vector<std::string> uris;
  if (options.udp.empty()) {
    const fs::path folder = fs::absolute(options.ports_dir).lexically_normal();
    for (const std::string& name : names) {
      uris.push_back("serial:" + (folder / name).string() + ":" + std::to_string(kFleetBaud));
    }
    return uris;
  }
  const UdpBase base = parse_udp(options.udp);
  for (std::size_t k = 0; k < names.size(); ++k) {
    // Heads answer, so the vehicle calls them; sensors only talk, so the vehicle listens.
    const bool head = k < mission.heads.size();
    uris.push_back((head ? "udp:" : "udp:@") + base.host + ":" + std::to_string(base.port + k));
  }
  return uris;
}

/// The emulator's ends of the vehicle's ports.
class Ports {
 public:
  Ports(const Mission& mission, const EmulateOptions& options) {
    const std::vector<std::string> names = fleet_ports(mission);
    if (options.udp.empty()) {
      open_ptys(names, options.ports_dir);
    } else {
      open_udp(names.size(), mission.heads.size(), parse_udp(options.udp));
    }
  }

  [[nodiscard]] std::size_t size() const { return lines_.size(); }
  [[nodiscard]] const std::string& where(std::size_t port) const { return lines_[port].where; }
  [[nodiscard]] const hal::LockstepCounts& written() const { return written_; }
  [[nodiscard]] hal::LinuxPort& port(std::size_t port) { return *lines_[port].port; }

  void queue(std::size_t port, const emu::Bytes& bytes) {
    lines_[port].waiting.insert(lines_[port].waiting.end(), bytes.begin(), bytes.end());
  }
  /// Gives to the ports what waits. `keep`: bytes that a full line cannot take wait on; otherwise they are
  /// gone, as on a line that nobody listens to.
  void pump(bool keep) {
    const base::TimeUs now_us = monotonic_us();
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      Line& line = lines_[k];
      line.port->service(now_us);
      if (line.waiting.empty()) {
        continue;
      }
      const bool clogged = !keep && line.port->pending_out_bytes() > 0;
      const std::size_t room = clogged ? 0 : line.port->write_room();
      const std::size_t size = std::min(room, line.waiting.size());
      const std::size_t taken = size > 0 ? line.port->write(line.waiting.data(), size) : 0;
      written_.bytes[k] += taken;
      const std::size_t gone = keep && !line.datagrams ? taken : line.waiting.size();
      line.waiting.erase(line.waiting.begin(),
                         line.waiting.begin() + static_cast<std::ptrdiff_t>(gone));
    }
  }

  /// Pushes on what ports still hold of bytes that were given to them.
  void flush() {
    for (Line& line : lines_) {
      line.port->service(monotonic_us());
    }
  }

  /// Reads what is there, at most `limit` bytes, and passes it on.
  std::size_t read(std::size_t port, std::size_t limit, base::TimeUs t_us, Fleet* fleet) {
    std::array<std::uint8_t, 4096> buffer{};
    base::TimeUs ignored_us = 0;
    const std::size_t got = lines_[port].port->read(monotonic_us(), buffer.data(),
                                                    std::min(limit, buffer.size()), ignored_us);
    if (got > 0) {
      fleet->take(port, t_us, buffer.data(), got);
    }
    return got;
  }

 private:
  struct Line {
    std::unique_ptr<hal::PtyPair> pty;
    std::unique_ptr<hal::LinuxPort> socket;
    hal::LinuxPort* port = nullptr;
    std::string where;
    bool datagrams = false;
    emu::Bytes waiting;
  };

  void open_ptys(const std::vector<std::string>& names, const std::string& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) {
      throw HostError(ExitCode::kOutput, folder + ": cannot be made: " + error.message());
    }
    for (const std::string& name : names) {
      Line line;
      line.pty = std::make_unique<hal::PtyPair>((fs::path(folder) / name).string());
      if (!line.pty->error().empty()) {
        throw HostError(ExitCode::kOutput, "emulate: " + line.pty->error());
      }
      line.port = &line.pty->port();
      line.where = line.pty->path();
      lines_.push_back(std::move(line));
    }
  }

  void open_udp(std::size_t count, std::size_t heads, const UdpBase& base) {
    if (base.port + count > 65536) {
      usage_error("--udp: " + std::to_string(count) + " ports from " + std::to_string(base.port) +
                  " on pass 65535");
    }
    for (std::size_t k = 0; k < count; ++k) {
      Line line;
      line.where = (k < heads ? "udp:@" : "udp:") + base.host + ":" + std::to_string(base.port + k);
      hal::PortResult made = hal::make_port(hal::parse_uri(line.where).spec);
      if (!made.port) {
        throw HostError(ExitCode::kUsage, "emulate: " + line.where + ": " + made.error);
      }
      line.socket = std::move(made.port);
      line.port = line.socket.get();
      line.datagrams = true;
      lines_.push_back(std::move(line));
    }
  }

  std::vector<Line> lines_;
  hal::LockstepCounts written_;
};

/// Devices run up to `to_us`; what they say is queued.
void run_devices(Fleet* fleet, Ports* ports, base::TimeUs to_us) {
  std::vector<emu::Bytes> bytes(ports->size());
  fleet->advance(to_us, &bytes);
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    ports->queue(k, bytes[k]);
  }
}

void fly_real(Fleet* fleet, Ports* ports, double speed, base::TimeUs* now_us) {
  Progress progress("emulating", static_cast<std::uint64_t>(fleet->t_end_us()));
  const base::TimeUs begin_us = monotonic_us();
  while (*now_us < fleet->t_end_us() && !StopSignals::stopped()) {
    const auto real_us = static_cast<double>(monotonic_us() - begin_us);
    const auto target_us = std::min(static_cast<base::TimeUs>(real_us * speed), fleet->t_end_us());
    while (*now_us < target_us) {
      *now_us = std::min(*now_us + kStep_us, target_us);
      for (std::size_t k = 0; k < ports->size(); ++k) {
        (void)ports->read(k, SIZE_MAX, *now_us, fleet);
      }
      run_devices(fleet, ports, *now_us);
      ports->pump(false);
    }
    progress.update_now(static_cast<std::uint64_t>(*now_us));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

/// The emulator's side of virtual time (hal/linux/lockstep.hpp).
class LockstepFlight {
 public:
  LockstepFlight(Fleet* fleet, Ports* ports, const EmulateOptions& options)
      : fleet_(fleet),
        ports_(ports),
        wait_ms_(static_cast<int>(options.wait_s * 1e3)),
        speed_(options.speed) {
    if (!server_.listen(options.lockstep_path)) {
      throw HostError(ExitCode::kUsage,
                      "emulate: --lockstep " + options.lockstep_path + ": " + server_.error());
    }
  }

  void fly(base::TimeUs* now_us) {
    wait_for_vehicle();
    Progress progress("emulating", static_cast<std::uint64_t>(fleet_->t_end_us()));
    step(*now_us);
    const base::TimeUs begin_us = monotonic_us();
    while (*now_us < fleet_->t_end_us() && !StopSignals::stopped()) {
      *now_us += kStep_us;
      keep_pace(begin_us, *now_us);
      run_devices(fleet_, ports_, *now_us);
      if (*now_us % kGrant_us == 0) {
        step(*now_us);
        progress.update(static_cast<std::uint64_t>(*now_us));
      }
    }
    check(server_.finish(wait_ms_), "to take the end");
  }

 private:
  void wait_for_vehicle() {
    const base::TimeUs until_us = monotonic_us() + base::TimeUs{wait_ms_} * 1000;
    hal::LockstepStatus status = hal::LockstepStatus::kTimeout;
    while (status == hal::LockstepStatus::kTimeout && monotonic_us() < until_us &&
           !StopSignals::stopped()) {
      status = server_.accept(kPoll_ms);
    }
    check(status, "to come");
  }

  /// Waits until the flight's time has come, where it is to be watched.
  void keep_pace(base::TimeUs begin_us, base::TimeUs flown_us) const {
    if (!speed_) {
      return;
    }
    const auto due_us =
        begin_us + static_cast<base::TimeUs>(static_cast<double>(flown_us) / *speed_);
    const base::TimeUs early_us = due_us - monotonic_us();
    if (early_us > 0) {
      std::this_thread::sleep_for(std::chrono::microseconds(early_us));
    }
  }

  void step(base::TimeUs t_us) {
    ports_->pump(true);
    check(server_.grant(t_us, ports_->written(), wait_ms_), "to take an instant");
    hal::LockstepCounts requested;
    const base::TimeUs until_us = monotonic_us() + base::TimeUs{wait_ms_} * 1000;
    hal::LockstepStatus status = server_.wait_answer(requested, 0);
    while (status == hal::LockstepStatus::kTimeout && monotonic_us() < until_us &&
           !StopSignals::stopped()) {
      // A full pty holds back bytes that were granted already.
      ports_->flush();
      status = server_.wait_answer(requested, kPoll_ms);
    }
    check(status, "to answer");
    for (std::size_t k = 0; k < ports_->size(); ++k) {
      take_requests(k, requested.bytes[k], t_us, until_us);
    }
  }

  /// Exactly the bytes that the vehicle says it wrote.
  void take_requests(std::size_t port, std::uint64_t total, base::TimeUs t_us,
                     base::TimeUs until_us) {
    while (taken_.bytes[port] < total && !StopSignals::stopped()) {
      const std::size_t missing = total - taken_.bytes[port];
      const std::size_t got = ports_->read(port, missing, t_us, fleet_);
      taken_.bytes[port] += got;
      if (got > 0) {
        continue;
      }
      if (monotonic_us() > until_us) {
        throw HostError(ExitCode::kInput, "emulate: " + ports_->where(port) +
                                              ": the vehicle says that it wrote " +
                                              std::to_string(total) + " bytes, " +
                                              std::to_string(taken_.bytes[port]) + " came");
      }
      pollfd wanted{ports_->port(port).poll_fd(), POLLIN, 0};
      (void)poll(&wanted, 1, kPoll_ms);
    }
  }

  void check(hal::LockstepStatus status, const char* what) {
    if (status == hal::LockstepStatus::kOk || StopSignals::stopped()) {
      return;
    }
    const std::string why = status == hal::LockstepStatus::kSystem
                                ? server_.error()
                                : hal::lockstep_status_text(status);
    throw HostError(ExitCode::kInput,
                    std::string("emulate: waited for the vehicle ") + what + ": " + why);
  }

  Fleet* fleet_;
  Ports* ports_;
  int wait_ms_;
  std::optional<double> speed_;
  hal::LockstepServer server_;
  hal::LockstepCounts taken_;
};

void write_config(const EmulateOptions& options, const Mission& mission) {
  if (const hal::UriResult link = hal::parse_uri(options.link_uri); !link.ok()) {
    usage_error("--link: " + link.error);
  }
  const Terrain ground = build_ground(mission);
  OutputDir out(options.write_config_dir);
  MissionLinks links;
  links.port_uris = vehicle_uris(mission, options);
  links.link_uri = options.link_uri;
  links.log_path = options.log_path;
  out.write("vehicle.toml", mission_vehicle_toml(mission, ground, links));
  std::string names;
  for (const MissionTable& table : mission_tables(mission)) {
    save_table(out.stage(table.name), table.table);
    names += ", " + table.name;
  }
  out.write("truth.asc",
            format_esri_ascii(truth_raster(mission, ground), raster_decimals(ground.cell_m())));
  out.commit();
  std::cout << "written to " << options.write_config_dir << ": vehicle.toml" << names
            << ", truth.asc\n";
}

}  // namespace

std::string fleet_summary_json(const Fleet& fleet, base::TimeUs flown_us) {
  const FleetCounters& pings = fleet.counters();
  const emu::FaultCounters faults = fleet.faults();
  const Raster touched = touched_raster(fleet.mission(), fleet.ground(), fleet.touched());
  double sum = 0.0;
  for (const double value : touched.values) {
    sum += value;
  }
  const double share = sum / static_cast<double>(touched.values.size());
  return "{\n  \"seconds\": " + json_number(static_cast<double>(flown_us) * 1e-6) +
         ",\n  \"pings\": " + std::to_string(pings.pings) +
         ",\n  \"echoes\": " + std::to_string(pings.echoes) +
         ",\n  \"outliers\": " + std::to_string(pings.outliers) +
         ",\n  \"dropouts\": " + std::to_string(pings.dropouts) +
         ",\n  \"device_bytes\": " + std::to_string(faults.bytes_out) +
         ",\n  \"bytes_lost\": " + std::to_string(faults.dropped) +
         ",\n  \"bytes_changed\": " + std::to_string(faults.corrupted) +
         ",\n  \"bytes_repeated\": " + std::to_string(faults.repeated) +
         ",\n  \"touched_fraction\": " + json_number(share) + "\n}\n";
}

void stage_truth(OutputDir* out, const Fleet& fleet) {
  const Mission& mission = fleet.mission();
  out->write("truth.asc", format_esri_ascii(truth_raster(mission, fleet.ground()),
                                            raster_decimals(fleet.ground().cell_m())));
  out->write("touched.asc",
             format_esri_ascii(touched_raster(mission, fleet.ground(), fleet.touched()), 0));
}

int run_emulate(const EmulateOptions& options) {
  const double speed = options.speed.value_or(1.0);
  check_limits("--speed", speed, {0, 1e4, true});
  check_limits("--wait", options.wait_s, {0, 86400, true}, "seconds");
  const Mission mission = resolve_mission(options.mission);
  if (!options.write_config_dir.empty()) {
    write_config(options, mission);
    return static_cast<int>(ExitCode::kOk);
  }
  const StopSignals signals;
  Fleet fleet(mission);
  std::unique_ptr<OutputDir> out;
  if (!options.out_dir.empty()) {
    out = std::make_unique<OutputDir>(options.out_dir);
  }
  Ports ports(mission, options);
  const std::vector<std::string> uris = vehicle_uris(mission, options);
  for (std::size_t k = 0; k < ports.size(); ++k) {
    std::cerr << "emulate: " << fleet.port_names()[k] << " at " << uris[k] << "\n";
  }
  base::TimeUs now_us = 0;
  if (options.lockstep_path.empty()) {
    fly_real(&fleet, &ports, speed, &now_us);
  } else {
    LockstepFlight(&fleet, &ports, options).fly(&now_us);
  }
  const std::string summary = fleet_summary_json(fleet, now_us);
  if (out) {
    stage_truth(out.get(), fleet);
    out->write("emulate.json", summary);
    out->commit();
  }
  if (options.json) {
    std::cout << summary;
  } else {
    std::cout << "flew " << now_us / 1'000'000 << " s: " << fleet.counters().pings << " pings, "
              << fleet.counters().echoes << " echoes of the ground, " << fleet.counters().outliers
              << " outliers, " << fleet.counters().dropouts << " not heard\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
