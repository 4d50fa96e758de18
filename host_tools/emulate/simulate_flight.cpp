#include "host_tools/emulate/simulate_flight.hpp"

#include <algorithm>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "host_tools/emulate/emulate_command.hpp"
#include "host_tools/emulate/vehicle_config.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/host_vehicle.hpp"

namespace leadline::host {
namespace {

// After the flight the link may take this long to say the rest.
constexpr base::TimeUs kLongestDrain_us = 120'000'000;
constexpr std::size_t kLogBuffer_bytes = std::size_t{1} << 20U;
constexpr const char* kLogName = "survey.lll";

/// One flight under way.
class Flight {
 public:
  Flight(PortDevices* devices, firmware::Vehicle* vehicle, std::int32_t cycle_us,
         const FlightSinks& sinks, Soundings* soundings)
      : devices_(devices),
        vehicle_(vehicle),
        cycle_us_(cycle_us),
        sinks_(sinks),
        soundings_(soundings),
        buffer_(kLogBuffer_bytes),
        writer_(buffer_.data(), buffer_.size()) {}

  FlightSummary fly(const std::vector<std::vector<std::uint8_t>>& tables) {
    begin_log(tables);
    cycle();
    const base::TimeUs end_us = devices_->t_end_us();
    base::TimeUs cycle_due_us = cycle_us_;
    while (now_us_ < end_us) {
      now_us_ = std::min({devices_->next_us(now_us_), cycle_due_us, end_us});
      gather();
      if (now_us_ == cycle_due_us) {
        cycle();
        cycle_due_us += cycle_us_;
      }
      if (sinks_.progress) {
        sinks_.progress(static_cast<std::uint64_t>(now_us_), static_cast<std::uint64_t>(end_us));
      }
    }
    drain();
    summary_.flown_us = now_us_;
    summary_.end = firmware::log_end_of(*vehicle_, last_cycle_us_);
    must(writer_.end(summary_.end));
    flush();
    return summary_;
  }

 private:
  void must(base::Status status) const {
    if (status != base::Status::kOk) {
      throw std::logic_error(std::string("simulate: a log record cannot be made: ") +
                             base::status_text(status));
    }
  }

  void begin_log(const std::vector<std::vector<std::uint8_t>>& tables) {
    std::vector<firmware::TableBlock> blocks;
    for (const std::vector<std::uint8_t>& table : tables) {
      blocks.push_back({table.data(), table.size()});
    }
    for (int copy = 0; copy < firmware::kLogPreambleCopies; ++copy) {
      must(firmware::log_begin(writer_, vehicle_->config(), blocks.data(), blocks.size(), 0, 0));
      flush();
    }
  }

  void flush() {
    if (sinks_.log) {
      sinks_.log(writer_.data(), writer_.size_bytes());
    }
    writer_.clear();
  }

  void gather() {
    std::vector<emu::Bytes> bytes(devices_->port_count());
    devices_->advance(now_us_, &bytes);
    for (std::size_t port = 0; port < bytes.size(); ++port) {
      const emu::Bytes& all = bytes[port];
      for (std::size_t at = 0; at < all.size(); at += firmware::kMaxChunk_bytes) {
        const std::size_t end = std::min(at + firmware::kMaxChunk_bytes, all.size());
        if (heard_.size() == firmware::kMaxCycleChunks) {
          cycle();  // all of this came at one instant
        }
        heard_.push_back({static_cast<std::uint8_t>(port),
                          now_us_,
                          {all.begin() + static_cast<std::ptrdiff_t>(at),
                           all.begin() + static_cast<std::ptrdiff_t>(end)}});
      }
    }
  }

  void cycle() {
    std::vector<firmware::InputChunk> chunks;
    for (const Heard& heard : heard_) {
      chunks.push_back({heard.t_us, heard.bytes.data(),
                        static_cast<std::uint16_t>(heard.bytes.size()), heard.port});
    }
    const firmware::CycleInput input{now_us_, chunks.data(), chunks.size(),
                                     static_cast<std::uint32_t>(firmware::kDownlinkCapacity_bytes)};
    firmware::CycleOutput output{};
    vehicle_->cycle(input, output);
    must(firmware::log_cycle(writer_, static_cast<std::uint32_t>(summary_.cycles), input, output));
    flush();
    summary_.cycles += 1;
    last_cycle_us_ = now_us_;
    heard_.clear();
    if (soundings_ != nullptr) {
      soundings_->take(*vehicle_);
    }
    if (sinks_.downlink && output.downlink.size_bytes > 0) {
      sinks_.downlink(output.downlink.data, output.downlink.size_bytes);
    }
    for (std::size_t port = 0; port < devices_->port_count(); ++port) {
      const firmware::OutputSpan& request = output.device_requests[port];
      if (request.size_bytes > 0) {
        devices_->take(port, now_us_, request.data, request.size_bytes);
      }
    }
  }

  void drain() {
    const base::TimeUs until_us = now_us_ + kLongestDrain_us;
    while (!vehicle_->drained() && now_us_ < until_us) {
      now_us_ += cycle_us_;
      cycle();
    }
    summary_.drained = vehicle_->drained();
    const firmware::VehicleCounters& counters = vehicle_->counters();
    summary_.mean_cell_wait_s =
        1e-3 * static_cast<double>(counters.cell_wait_ms) /
        static_cast<double>(std::max<std::uint64_t>(counters.cells_changed, 1));
  }

  struct Heard {
    std::uint8_t port;
    base::TimeUs t_us;
    emu::Bytes bytes;
  };

  PortDevices* devices_;
  firmware::Vehicle* vehicle_;
  std::int32_t cycle_us_;
  const FlightSinks& sinks_;
  Soundings* soundings_;
  std::vector<std::uint8_t> buffer_;
  proto::LogWriter writer_;
  base::TimeUs now_us_ = 0;
  base::TimeUs last_cycle_us_ = 0;
  std::vector<Heard> heard_;
  FlightSummary summary_;
};

MissionLinks simulated_links(const Mission& mission) {
  MissionLinks links;
  // Nobody opens them: the configuration is complete so that the same file flies over real ports.
  for (const std::string& name : fleet_ports(mission)) {
    links.port_uris.push_back("serial:ports/" + name + ":" + std::to_string(kFleetBaud));
  }
  links.link_uri = "udp:127.0.0.1:9100";
  return links;
}

std::string summary_json(const Fleet& fleet, const FlightSummary& flight, const Receiver& receiver,
                         std::uint64_t log_bytes) {
  const bool equal =
      receiver.store() != nullptr && receiver.store()->cells_hash() == flight.end.cells_hash;
  std::string text = fleet_summary_json(fleet, flight.flown_us);
  text.resize(text.rfind("\n}"));
  text +=
      ",\n  \"cycles\": " + std::to_string(flight.cycles) +
      ",\n  \"pings_in\": " + std::to_string(flight.end.pings_in) +
      ",\n  \"pings_fused\": " + std::to_string(flight.end.pings_fused) +
      ",\n  \"drained\": " + (flight.drained ? "true" : "false") +
      ",\n  \"topside_equals_vehicle\": " + (equal ? "true" : "false") +
      ",\n  \"bytes_per_changed_cell\": " + json_number(receiver.bytes_per_changed_cell()) +
      ",\n  \"bytes_per_changed_cell_all\": " + json_number(receiver.bytes_per_changed_cell_all()) +
      ",\n  \"mean_cell_wait_s\": " + json_number(flight.mean_cell_wait_s) +
      ",\n  \"downlink_bytes\": " + std::to_string(flight.end.downlink_bytes) +
      ",\n  \"log_bytes\": " + std::to_string(log_bytes) + "\n}\n";
  return text;
}

}  // namespace

std::vector<std::vector<std::uint8_t>> table_bytes(const std::vector<MissionTable>& tables) {
  std::vector<std::vector<std::uint8_t>> bytes;
  for (const MissionTable& table : tables) {
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(&table.table);
    bytes.emplace_back(begin, begin + sizeof table.table);
  }
  return bytes;
}

FlightSummary fly_in_process(PortDevices* devices, firmware::Vehicle* vehicle,
                             const std::vector<std::vector<std::uint8_t>>& tables,
                             std::int32_t cycle_us, const FlightSinks& sinks,
                             Soundings* soundings) {
  return Flight(devices, vehicle, cycle_us, sinks, soundings).fly(tables);
}

int run_simulated_flight(const FlightOptions& options) {
  if (options.out_dir.empty()) {
    throw HostError(ExitCode::kUsage, "simulate: the folder to write to is missing (--out DIR)");
  }
  const Mission mission = resolve_mission(options.mission);
  Fleet fleet(mission);
  OutputDir out(options.out_dir);
  const std::string toml = mission_vehicle_toml(mission, fleet.ground(), simulated_links(mission));
  VehicleFile file = parse_vehicle_file(toml, "vehicle.toml", "");
  const std::vector<MissionTable> blocks = mission_tables(mission);
  std::vector<model::LocalizationTable> by_number;
  for (const MissionTable& block : blocks) {
    by_number.push_back(block.table);
  }
  set_default_budget(by_number, &file);
  const std::vector<std::vector<std::uint8_t>> tables = table_bytes(blocks);
  const HostVehicle vehicle(file.config, tables, "vehicle.toml");

  OutputFile log(out.stage(kLogName), options.out_dir + "/" + kLogName);
  std::uint64_t log_bytes = 0;
  Receiver receiver;
  std::unique_ptr<Progress> bar;
  FlightSinks sinks;
  sinks.log = [&](const std::uint8_t* data, std::size_t size) {
    log.write({reinterpret_cast<const char*>(data), size});
    log_bytes += size;
  };
  sinks.downlink = [&](const std::uint8_t* data, std::size_t size) { receiver.feed(data, size); };
  sinks.progress = [&](std::uint64_t done, std::uint64_t total) {
    if (!bar) {
      bar = std::make_unique<Progress>("simulating", total);
    }
    bar->update(done);
  };
  Soundings soundings;
  const FlightSummary flight =
      fly_in_process(&fleet, &*vehicle, tables, file.cycle_us, sinks, &soundings);
  bar.reset();
  log.close();

  const std::string summary = summary_json(fleet, flight, receiver, log_bytes);
  out.write("vehicle.toml", toml);
  for (const MissionTable& block : blocks) {
    save_table(out.stage(block.name), block.table);
  }
  stage_truth(&out, fleet);
  out.write("pings.csv", soundings.csv());
  MapConfig map = flight_map_config(file.config, blocks.front().table);
  map.sonar.beam_half_angle_deg = mission.heads.front().beam_half_angle_deg;
  out.write("map.toml", map_config_to_toml(map));
  out.write("flight.json", summary);
  out.commit();
  if (options.json) {
    std::cout << summary;
  } else {
    std::cout << "flew " << flight.flown_us / 1'000'000 << " s in " << flight.cycles
              << " cycles: " << flight.end.pings_in << " pings, " << flight.end.pings_fused
              << " in the map, " << flight.end.downlink_bytes << " bytes on the link\nwritten to "
              << options.out_dir << ": " << kLogName << " (" << log_bytes
              << " bytes), vehicle.toml, tables,\n"
              << "  truth.asc, touched.asc, pings.csv, map.toml, flight.json\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
