// A serial line without hardware: the emulator's and the tests' end of a pty. The other end is opened
// like any serial device, by its name or by a symbolic link with a name of the caller's choice.
#pragma once

#include <memory>
#include <string>

#include "hal/linux/linux_port.hpp"

namespace leadline::hal {

/// Host code: the constructor allocates and throws nothing; check error(). One owner.
class PtyPair {
 public:
  /// `link_path`: symbolic link to the device, replaces one to another pty, nothing else;
  /// removed at the end if it is still ours. "" = none.
  explicit PtyPair(std::string link_path = "");
  ~PtyPair();
  PtyPair(const PtyPair&) = delete;
  PtyPair& operator=(const PtyPair&) = delete;

  /// Empty when plugged and well, else what failed.
  [[nodiscard]] const std::string& error() const { return error_; }
  /// link_path, or the device's own name (/dev/pts/N). "" while unplugged.
  [[nodiscard]] std::string path() const;
  /// This end. Closed while unplugged; what is written then is counted as dropped. Lives as long as
  /// the pair, through unplug() and plug().
  [[nodiscard]] LinuxPort& port();

  /// The adapter is pulled: this end closes, whoever has the other open sees a hang-up; the link goes.
  void unplug();
  /// A new pty under the same link. False: error() says why. Does nothing while plugged.
  bool plug();

 private:
  class MasterPort;

  std::string link_path_;
  std::string device_;
  std::string error_;
  int slave_fd_ = -1;  ///< held open: bytes written before the other end opens are kept, and raw
  std::unique_ptr<MasterPort> port_;
};

}  // namespace leadline::hal
