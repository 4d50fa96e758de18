#include "host_tools/import/byte_source.hpp"

#include <algorithm>
#include <fstream>
#include <iostream>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kRead_bytes = 65536;

}  // namespace

ByteSource::ByteSource(const std::string& path) : name_(path) {
  if (path == "-") {
    name_ = "standard input";
    stream_ = &std::cin;
    return;
  }
  path_ = path;
  owned_ = std::make_unique<std::ifstream>(open_input(path));
  stream_ = owned_.get();
}

ByteSource::ByteSource(const std::uint8_t* data, std::size_t size) : buffer_(data, data + size) {}

std::size_t ByteSource::peek(std::size_t size) {
  while (buffer_.size() - begin_ < size && stream_ != nullptr && *stream_) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
    const std::size_t kept = buffer_.size();
    const std::size_t wanted = std::max(size - kept, kRead_bytes);
    buffer_.resize(kept + wanted);
    stream_->read(reinterpret_cast<char*>(buffer_.data() + kept),
                  static_cast<std::streamsize>(wanted));
    buffer_.resize(kept + static_cast<std::size_t>(stream_->gcount()));
    if (stream_->bad()) {
      throw HostError(ExitCode::kInput, name_ + ": cannot be read");
    }
  }
  return std::min(size, buffer_.size() - begin_);
}

void ByteSource::skip(std::size_t size) { begin_ += size; }

bool ByteSource::line(std::string* text, std::size_t max_bytes) {
  text->clear();
  bool any = false;
  while (peek(1) == 1) {
    any = true;
    const std::uint8_t byte = *data();
    skip(1);
    if (byte == '\n') {
      break;
    }
    if (text->size() < max_bytes) {
      text->push_back(static_cast<char>(byte));
    }
  }
  if (!text->empty() && text->back() == '\r') {
    text->pop_back();
  }
  return any;
}

}  // namespace leadline::host
