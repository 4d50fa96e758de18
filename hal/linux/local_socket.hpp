// Stream sockets of this machine, named by a path: what lockstep and shared links go over.
#pragma once

#include <string>

#include <sys/types.h>

namespace leadline::hal {

/// A socket on the way to whoever listens at `path`, not blocking; -1: errno says why (ENAMETOOLONG: the path has
/// not 1 to 107 bytes).
[[nodiscard]] int connect_local(const std::string& path);
/// What an errno of a local socket means.
[[nodiscard]] std::string local_socket_error(int number);

/// Listens at a path that only this user (and root) reaches: mode 0600. The file goes with the object, if it is still
/// the one that it made.
class LocalListener {
 public:
  LocalListener() = default;
  ~LocalListener();
  LocalListener(const LocalListener&) = delete;
  LocalListener& operator=(const LocalListener&) = delete;

  /// A socket there that nobody listens at any more is replaced; anything else that is there is not. Returns "" or
  /// what is wrong. Once.
  [[nodiscard]] std::string listen(const std::string& path);
  /// The next peer, not blocking; -1: errno (EAGAIN: nobody waits).
  [[nodiscard]] int accept() const;
  [[nodiscard]] int fd() const { return fd_; }

 private:
  int fd_ = -1;
  dev_t device_ = 0;  ///< of the file
  ino_t inode_ = 0;
  std::string path_;
};

}  // namespace leadline::hal
