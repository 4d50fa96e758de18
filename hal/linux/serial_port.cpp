#include "hal/linux/serial_port.hpp"

#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
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

namespace {

/// A pty holds what its other end wrote and nothing else: there is no noise of plugging in, nothing stale.
bool is_pty(int fd) {
  constexpr unsigned kFirstPtyMajor = 136;
  constexpr unsigned kLastPtyMajor = 143;
  struct stat info {};
  if (::fstat(fd, &info) != 0 || !S_ISCHR(info.st_mode)) {
    return false;
  }
  return major(info.st_rdev) >= kFirstPtyMajor && major(info.st_rdev) <= kLastPtyMajor;
}

}  // namespace

StreamPort::OpenResult SerialPort::open_now() {
  const int fd = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    return OpenResult::kFailed;
  }
  adopt(fd);
  if (!make_raw(fd, baud_)) {
    return OpenResult::kFailed;
  }
  // What came before, at another rate or from before the plug was pulled, has no time and may be garbage.
  return is_pty(fd) || tcflush(fd, TCIFLUSH) == 0 ? OpenResult::kOpen : OpenResult::kFailed;
}

}  // namespace leadline::hal
