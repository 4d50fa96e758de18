// The vehicle between its lines: what firmware/linux/vehicle_loop is to Linux, without files and without a
// recorder. Port k of the configuration is UART k of the board, the link is the last UART.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/m7/fault_record.hpp"
#include "firmware/pipeline/config_block.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "hal/m7/clock.hpp"
#include "hal/m7/uart_port.hpp"
#include "model/base/units.hpp"

namespace leadline::firmware::m7 {

inline constexpr int kLinkUart = hal::m7::kUarts - 1;
/// Device ports that the board has lines for.
inline constexpr int kBoardPorts = kLinkUart;

/// The lines, for the interrupts.
extern hal::m7::UartPort lines[hal::m7::kUarts];
extern hal::m7::Clock board_clock;
/// The one vehicle of an image.
extern Vehicle the_vehicle;

/// Reads the block in flash and configures the vehicle; what cannot be flown ends in fail(). Spans of the
/// result point into flash. `session` is added to the configuration's, so that no two starts share one.
const ConfigBlock& configure_from_flash(std::uint32_t session);

/// Input of one cycle.
class CycleBuffer {
 public:
  /// Of all lines together; what is beyond waits in the rings of the lines.
  static constexpr std::size_t kBytes = 8192;
  static constexpr std::size_t kChunks = 128;

  void clear();
  /// One burst of a line; what came at the same time as the chunk before goes into that. False: it has none
  /// now, or there is no room. Its arrival is brought between the two times.
  bool read(hal::m7::UartPort& line, std::uint8_t number, base::TimeUs earliest_us,
            base::TimeUs latest_us);
  /// Bytes of our own. False: no room.
  bool add(std::uint8_t number, base::TimeUs t_us, const std::uint8_t* data,
           std::size_t size_bytes);

  [[nodiscard]] const InputChunk* chunks() const { return chunks_.data(); }
  [[nodiscard]] std::size_t chunk_count() const { return count_; }

 private:
  std::array<std::uint8_t, kBytes> bytes_{};
  std::array<InputChunk, kChunks> chunks_{};
  std::size_t used_bytes_ = 0;
  std::size_t count_ = 0;
};

class FlightLoop {
 public:
  /// Opens the lines. `restart`: the record of the failure before this start, cause kNone: none.
  void open(const ConfigBlock& block, const FaultRecord& restart);

  [[nodiscard]] int port_count() const { return port_count_; }
  /// Takes what the lines have for the cycle at `latest_us`; the cycle before was at `earliest_us`. What comes
  /// while this one gathers came with its begin; what a flood left waiting, with that of the one before.
  void gather(base::TimeUs earliest_us, base::TimeUs latest_us);
  /// The cycle: our own report, the vehicle, what it sends. `measured_us`: how long the last one took, 0: not
  /// measured.
  void run(base::TimeUs t_us, std::uint32_t measured_us);
  [[nodiscard]] CycleBuffer& buffer() { return buffer_; }
  /// Of the last run(), until the next.
  [[nodiscard]] const CycleInput& input() const { return input_; }
  [[nodiscard]] const CycleOutput& output() const { return output_; }
  [[nodiscard]] std::uint32_t cycles() const { return cycles_; }

 private:
  void report(base::TimeUs t_us, std::uint32_t measured_us);
  void send();

  int port_count_ = 0;
  bool restarted_ = false;
  std::uint32_t cycles_ = 0;
  std::uint32_t longest_us_ = 0;
  bool reported_ = false;
  base::TimeUs report_due_us_ = 0;
  CycleBuffer buffer_;
  CycleInput input_{};
  CycleOutput output_{};
};

}  // namespace leadline::firmware::m7
