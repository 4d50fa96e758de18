// A tty as a byte port. Inside of hal/linux; users take linux_port.hpp.
#pragma once

#include <cstdint>
#include <string>

#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

/// The tty at `fd` raw, 8N1, no flow control, reads that return what is there. False: errno says why.
[[nodiscard]] bool make_raw(int fd, std::uint32_t baud);

class SerialPort final : public StreamPort {
 public:
  explicit SerialPort(const UriSpec& spec) : path_(spec.path), baud_(spec.baud) {}

 private:
  OpenResult open_now() override;

  std::string path_;
  std::uint32_t baud_;
};

}  // namespace leadline::hal
