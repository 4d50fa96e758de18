#include "hal/linux/serial_port.hpp"

#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

namespace leadline::hal {
namespace {

constexpr std::array<std::pair<std::uint32_t, speed_t>, 22> kSpeeds = {{
    {1200, B1200},         {1800, B1800},         {2400, B2400},         {4800, B4800},
    {9600, B9600},         {19'200, B19200},      {38'400, B38400},      {57'600, B57600},
    {115'200, B115200},    {230'400, B230400},    {460'800, B460800},    {500'000, B500000},
    {576'000, B576000},    {921'600, B921600},    {1'000'000, B1000000}, {1'152'000, B1152000},
    {1'500'000, B1500000}, {2'000'000, B2000000}, {2'500'000, B2500000}, {3'000'000, B3000000},
    {3'500'000, B3500000}, {4'000'000, B4000000},
}};

}  // namespace

bool make_raw(int fd, std::uint32_t baud) {
  termios settings{};
  if (tcgetattr(fd, &settings) != 0) {
    return false;
  }
  cfmakeraw(&settings);
  settings.c_cflag |= static_cast<tcflag_t>(CLOCAL | CREAD);
  settings.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | CSTOPB | HUPCL);
  settings.c_iflag &= ~static_cast<tcflag_t>(IXOFF | IXANY);
  // One byte at least: nothing to read is then EAGAIN, and an end of file is a hang-up.
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  for (const auto& [rate, constant] : kSpeeds) {
    if (rate == baud) {
      return cfsetspeed(&settings, constant) == 0 && tcsetattr(fd, TCSANOW, &settings) == 0;
    }
  }
  errno = EINVAL;
  return false;
}

StreamPort::OpenResult SerialPort::open_now() {
  // What has arrived before is kept: it may be all that a device ever says.
  const int fd = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    return OpenResult::kFailed;
  }
  adopt(fd);
  return make_raw(fd, baud_) ? OpenResult::kOpen : OpenResult::kFailed;
}

}  // namespace leadline::hal
