// Results appear whole or not at all: everything is written under a staging name on the same file
// system, flushed to the disk, and renamed only when all of it is there.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

/// One file being written. Errors (no permission, disk full, file size limit) throw HostError
/// kOutput naming the file and the system's reason, from whichever call meets them.
class OutputFile {
 public:
  /// Creates or truncates `path`. `shown_name` is what messages call it ("" for the path itself).
  explicit OutputFile(const std::string& path, const std::string& shown_name = "");
  /// Takes over an open descriptor.
  OutputFile(int fd, const std::string& shown_name);
  /// Closes without a check when close() was not called: then the content is to be thrown away.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Appends; buffered, so an error may show up in a later call.
  void write(std::string_view bytes);
  /// Flushes to the disk (fsync where the file supports it) and closes.
  void close();

 private:
  void flush();

  std::string shown_name_;
  std::string buffer_;
  int fd_;
};

/// Writes one result outside an OutputDir (`--out FILE`): to a temporary name beside it, then
/// renames; a symbolic link stays and what it points to is replaced. A device or pipe is written
/// directly; "-" is standard output.
void write_file_whole(const std::string& path, std::string_view bytes);

/// The directory of a command's results. Until commit() nothing appears in it under a final name and
/// earlier results stay as they are; when the object goes without commit(), what was staged is
/// removed. A run that was killed leaves a directory `.leadline-staging-*`, which the next removes.
class OutputDir {
 public:
  /// Creates `path` with its parents when needed and a staging directory in it. Call it before the
  /// long work, so that an unwritable place is found at once. Throws HostError kOutput.
  explicit OutputDir(const std::string& path);
  ~OutputDir();
  OutputDir(const OutputDir&) = delete;
  OutputDir& operator=(const OutputDir&) = delete;

  /// Registers a result and returns the path under which to write it until then (same base name and
  /// extension, so that format drivers can go by it). `name` has no directory part.
  [[nodiscard]] std::string stage(const std::string& name);
  /// stage() and write.
  void write(const std::string& name, std::string_view bytes);
  /// Checks that every staged result exists, flushes them to the disk, renames them into place.
  /// After a failure here the results may be a mix of earlier and new ones; each is whole.
  void commit();

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  void discard();

  std::string path_;
  std::string staging_path_;
  std::vector<std::string> names_;
  int lock_fd_;
};

}  // namespace leadline::host
