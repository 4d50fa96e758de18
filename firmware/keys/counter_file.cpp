#include "firmware/keys/counter_file.hpp"

#include <cerrno>
#include <cstring>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "firmware/config/exit_codes.hpp"
#include "firmware/keys/small_file.hpp"

namespace leadline::host {
namespace {

/// Whose counters are taken one after the other: the key file itself is the lock.
class KeyLock {
 public:
  explicit KeyLock(const std::string& key_path)
      : fd_(::open(key_path.c_str(), O_RDONLY | O_CLOEXEC)) {
    while (fd_ >= 0 && ::flock(fd_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~KeyLock() {
    if (fd_ >= 0) {
      (void)::close(fd_);
    }
  }
  KeyLock(const KeyLock&) = delete;
  KeyLock& operator=(const KeyLock&) = delete;

 private:
  int fd_;
};

}  // namespace

firmware::CommandMark CounterFile::load() const {
  const SmallFile file(path_);
  firmware::CommandMark mark{};
  if (file.problem() == ENOENT) {
    return mark;
  }
  const auto refuse = [this](const std::string& why) {
    throw HostError(ExitCode::kUsage, path_ + ": " + why);
  };
  if (file.problem() != 0) {
    refuse(std::string("the counter of commands cannot be read: ") + std::strerror(file.problem()));
  }
  const std::vector<std::string>& lines = file.lines();
  const auto value = [&lines](std::size_t line, const std::string& name) {
    const bool there = line < lines.size() && lines[line].compare(0, name.size(), name) == 0;
    return there ? lines[line].substr(name.size()) : std::string();
  };
  std::uint64_t key_id = 0;
  const std::string tag = value(3, "tag ");
  bool good = lines.size() == 4 && value(0, "leadline-counter ") == "1" &&
              read_number(value(1, "key "), 16, UINT32_MAX, &key_id) &&
              read_number(value(2, "counter "), 10, UINT64_MAX, &mark.counter) &&
              tag.size() == 2 * sizeof mark.tag;
  for (std::size_t i = 0; good && i < sizeof mark.tag; ++i) {
    std::uint64_t byte = 0;
    good = read_number(tag.substr(2 * i, 2), 16, 255, &byte);
    mark.tag[i] = static_cast<std::uint8_t>(byte);
  }
  if (!good) {
    refuse(
        "the counter of commands is damaged: make a new key (`leadline key new`), then remove it");
  }
  if (key_id != key_id_) {
    refuse("is the counter of another key (" + hex_of(static_cast<std::uint32_t>(key_id)) +
           "): remove it if that key is never used again");
  }
  return mark;
}

int CounterFile::save(const firmware::CommandMark& mark) const {
  std::string text = "leadline-counter 1\nkey " + hex_of(key_id_) + "\ncounter " +
                     std::to_string(mark.counter) + "\ntag ";
  for (const std::uint8_t byte : mark.tag) {
    text += hex_of(byte).substr(6);
  }
  return replace_file(path_, text + "\n");
}

std::uint64_t take_counter(const std::string& key_path, std::uint32_t key_id, std::uint64_t more) {
  const KeyLock lock(key_path);
  const CounterFile file(key_path + ".sent", key_id);
  firmware::CommandMark mark = file.load();
  if (more > UINT64_MAX - mark.counter) {
    throw HostError(ExitCode::kUsage, file.path() +
                                          ": the counters of this key are used up: make a new one "
                                          "(`leadline key new`)");
  }
  mark.counter += more;
  const int problem = file.save(mark);
  if (problem != 0) {
    throw HostError(ExitCode::kOutput,
                    file.path() + ": cannot be written: " + std::strerror(problem));
  }
  return mark.counter;
}

}  // namespace leadline::host
