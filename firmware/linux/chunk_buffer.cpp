#include "firmware/linux/chunk_buffer.hpp"

#include <algorithm>
#include <cstring>

namespace leadline::host {

ChunkBuffer::ChunkBuffer(std::size_t sources, std::size_t share_bytes)
    : share_bytes_(share_bytes), bytes_(firmware::kMaxCycleBytes) {
  chunks_.reserve(sources * kMaxChunksPerSource + kOwnChunks);
}

void ChunkBuffer::clear() {
  filled_bytes_ = 0;
  chunks_.clear();
  used_bytes_.fill(0);
  used_chunks_.fill(0);
}

bool ChunkBuffer::has_room(const hal::LinuxPort& port, std::size_t source) const {
  const std::size_t least = port.datagrams() ? kDatagram_bytes : 1;
  return used_bytes_[source] + least <= share_bytes_ &&
         used_chunks_[source] < kMaxChunksPerSource && filled_bytes_ + least <= bytes_.size();
}

bool ChunkBuffer::extends(std::uint8_t number, base::TimeUs t_us) const {
  return !chunks_.empty() && chunks_.back().port == number && chunks_.back().t_arrival_us == t_us &&
         chunks_.back().size_bytes < firmware::kMaxChunk_bytes;
}

void ChunkBuffer::push(std::uint8_t number, base::TimeUs t_us, std::size_t size) {
  chunks_.push_back(
      {t_us, bytes_.data() + filled_bytes_, static_cast<std::uint16_t>(size), number});
  filled_bytes_ += size;
}

bool ChunkBuffer::read(hal::LinuxPort& port, std::size_t source, std::uint8_t number,
                       base::TimeUs now_us, std::size_t limit_bytes) {
  if (!has_room(port, source)) {
    return false;
  }
  const bool extend = !port.datagrams() && extends(number, now_us);
  const std::size_t chunk_room =
      firmware::kMaxChunk_bytes - (extend ? std::size_t{chunks_.back().size_bytes} : 0);
  const std::size_t room = std::min(
      {chunk_room, share_bytes_ - used_bytes_[source], bytes_.size() - filled_bytes_, limit_bytes});
  base::TimeUs t_arrival_us = now_us;
  const std::size_t size = port.read(now_us, bytes_.data() + filled_bytes_, room, t_arrival_us);
  if (size == 0) {
    return false;
  }
  used_bytes_[source] += size;
  if (extend) {
    chunks_.back().size_bytes = static_cast<std::uint16_t>(chunks_.back().size_bytes + size);
    filled_bytes_ += size;
    return true;
  }
  used_chunks_[source] += 1;
  push(number, t_arrival_us, size);
  return true;
}

bool ChunkBuffer::read_rest(hal::LinuxPort& port, std::size_t source, std::uint8_t number,
                            base::TimeUs now_us) {
  const std::size_t end = bytes_.size() - kReserve_bytes;
  const std::size_t room =
      filled_bytes_ < end ? std::min(firmware::kMaxChunk_bytes, end - filled_bytes_) : 0;
  if (port.held_bytes() == 0 || room == 0 || used_chunks_[source] >= kMaxChunksPerSource) {
    return false;
  }
  base::TimeUs t_arrival_us = now_us;
  const std::size_t size = port.read(now_us, bytes_.data() + filled_bytes_, room, t_arrival_us);
  used_chunks_[source] += 1;
  push(number, t_arrival_us, size);
  return size > 0;
}

void ChunkBuffer::retime(base::TimeUs t_us) {
  for (firmware::InputChunk& chunk : chunks_) {
    chunk.t_arrival_us = t_us;
  }
}

bool ChunkBuffer::add(std::uint8_t number, base::TimeUs t_us, const std::uint8_t* data,
                      std::size_t size) {
  if (size > bytes_.size() - filled_bytes_ || chunks_.size() == chunks_.capacity()) {
    return false;
  }
  std::memcpy(bytes_.data() + filled_bytes_, data, size);
  push(number, t_us, size);
  return true;
}

}  // namespace leadline::host
