// Virtual time for a vehicle program and an emulator in two processes (firmware/README.md): the bytes
// go through real ptys and sockets, the time goes through a Unix stream socket, one grant and one
// answer at a time. A run depends on its inputs alone, however loaded the machine is.
//
//   emulator (LockstepServer)                       vehicle (LockstepClient)
//   listens at PATH                                 connects
//   writes bytes to its ports
//   grant {t_us, bytes written to each port} ----->
//                                                   reads exactly those, runs a cycle at t_us,
//                                                   writes requests
//   reads exactly those requests             <----- answer {t_us, request bytes written to each port}
//
// All counts are cumulative since the ports were made. The vehicle waits for the bytes of open ports only;
// those of a port that is closed (unplugged) come when it is open again. The link's uplink has no
// emulator at its other end: the vehicle takes what is there. Grants end with finish(): the vehicle stops in order.
// A message is 4 + 4 + 8 + 16 * 8 bytes, little-endian: magic, kind, t_us, counts.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "hal/linux/local_socket.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// Counts per message: device ports by number, the link last (answers: downlink bytes).
inline constexpr int kLockstepPorts = 16;
inline constexpr int kLockstepLink = kLockstepPorts - 1;

struct LockstepCounts {
  std::array<std::uint64_t, kLockstepPorts> bytes{};
};

enum class LockstepStatus : std::uint8_t {
  kOk = 0,
  kTimeout = 1,   ///< nothing (whole) came in time
  kPeerGone = 2,  ///< closed, or reset
  kProtocol = 3,  ///< bytes that are no message, time or counts that go back
  kFinished = 4,  ///< the emulator has said finish()
  kSystem = 5,    ///< a system call failed: see error()
};
[[nodiscard]] const char* lockstep_status_text(LockstepStatus status);

struct LockstepMessage {
  std::uint32_t kind = 0;
  base::TimeUs t_us = 0;
  LockstepCounts counts;
};

/// Buffered message exchange over one connected socket; shared by both ends.
class LockstepChannel {
 public:
  LockstepChannel() = default;
  ~LockstepChannel();
  LockstepChannel(const LockstepChannel&) = delete;
  LockstepChannel& operator=(const LockstepChannel&) = delete;

  void adopt(int fd);
  void close();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] LockstepStatus send(const LockstepMessage& message, int timeout_ms);
  /// timeout_ms 0: only what is there.
  [[nodiscard]] LockstepStatus receive(LockstepMessage& message, int timeout_ms);

 private:
  int fd_ = -1;
  std::array<std::uint8_t, 144> buffer_{};
  std::size_t filled_ = 0;
};

/// The vehicle's side.
class LockstepClient {
 public:
  /// Tries for `timeout_ms` (the emulator may be about to start). False: error() says why.
  [[nodiscard]] bool connect(const std::string& path, int timeout_ms);
  [[nodiscard]] const std::string& error() const { return error_; }
  /// Waits for the next grant.
  [[nodiscard]] LockstepStatus wait_grant(base::TimeUs& t_us, LockstepCounts& written,
                                          int timeout_ms);
  [[nodiscard]] LockstepStatus answer(base::TimeUs t_us, const LockstepCounts& requested,
                                      int timeout_ms);
  [[nodiscard]] int fd() const { return channel_.fd(); }

 private:
  LockstepChannel channel_;
  base::TimeUs last_t_us_ = 0;
  LockstepCounts last_counts_;
  bool granted_ = false;
  std::string error_;
};

/// The emulator's side. The socket file goes with the object (LocalListener).
class LockstepServer {
 public:
  /// Listens at `path` (at most 107 bytes; a stale socket there is replaced). False: error().
  [[nodiscard]] bool listen(const std::string& path);
  /// Waits for the vehicle.
  [[nodiscard]] LockstepStatus accept(int timeout_ms);
  [[nodiscard]] const std::string& error() const { return error_; }

  /// Grants an instant; not before the answer to the one before. t_us and counts never go back.
  [[nodiscard]] LockstepStatus grant(base::TimeUs t_us, const LockstepCounts& written,
                                     int timeout_ms);
  /// Waits for the answer to the last grant. An emulator that still has queued bytes to push into a
  /// full pty calls it with 0 and pumps in between (fd() to poll for).
  [[nodiscard]] LockstepStatus wait_answer(LockstepCounts& requested, int timeout_ms);
  /// Tells the vehicle to stop in order.
  [[nodiscard]] LockstepStatus finish(int timeout_ms);
  [[nodiscard]] int fd() const { return channel_.fd(); }

 private:
  LockstepChannel channel_;
  LocalListener listener_;
  base::TimeUs last_t_us_ = 0;
  LockstepCounts last_requested_;
  std::string error_;
};

}  // namespace leadline::hal
