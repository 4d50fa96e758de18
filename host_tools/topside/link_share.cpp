#include "host_tools/topside/link_share.hpp"

#include <algorithm>
#include <cerrno>

#include <sys/socket.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"
#include "proto/commands.hpp"
#include "proto/messages.hpp"

namespace leadline::host {
namespace {

bool may_go_up(const proto::FrameView& frame) {
  proto::MessageType type{};
  return proto::message_type(frame.payload, frame.payload_bytes, type) &&
         frame.payload_bytes <= proto::kMaxCommand_bytes &&
         (type == proto::MessageType::kCommand || type == proto::MessageType::kHelloRequest);
}

}  // namespace

struct LinkShare::Guest {
  explicit Guest(int connection) : fd(connection) {}
  ~Guest() { ::close(fd); }
  Guest(const Guest&) = delete;
  Guest& operator=(const Guest&) = delete;

  int fd;
  proto::FrameDecoderBuffer<> frames;
};

LinkShare::LinkShare(const std::string& path) {
  const std::string problem = listener_.listen(path);
  if (!problem.empty()) {
    throw HostError(ExitCode::kOutput, "--share: " + problem);
  }
}

LinkShare::~LinkShare() = default;

void LinkShare::give(const std::uint8_t* data, std::size_t size_bytes) {
  for (auto& guest : guests_) {
    // A part would tear a frame, and the rest would need room here.
    if (guest &&
        ::send(guest->fd, data, size_bytes, MSG_NOSIGNAL) != static_cast<ssize_t>(size_bytes)) {
      counters_.cut_off += errno == EPIPE || errno == ECONNRESET ? 0U : 1U;
      guest.reset();
    }
  }
}

void LinkShare::serve(const std::function<bool(const std::vector<std::uint8_t>&)>& send) {
  for (int fd = listener_.accept(); fd >= 0; fd = listener_.accept()) {
    auto* const seat = std::find(guests_.begin(), guests_.end(), nullptr);
    if (seat == guests_.end()) {
      ::close(fd);
      counters_.refused += 1;
    } else {
      *seat = std::make_unique<Guest>(fd);
      counters_.joined += 1;
    }
  }
  std::array<std::uint8_t, kRound_bytes> bytes{};
  for (auto& guest : guests_) {
    if (!guest) {
      continue;
    }
    const ssize_t got = ::recv(guest->fd, bytes.data(), bytes.size(), 0);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
      guest.reset();
      continue;
    }
    const std::uint8_t* data = bytes.data();
    for (auto left = static_cast<std::size_t>(std::max<ssize_t>(got, 0)); left > 0;) {
      std::size_t used = 0;
      proto::FrameView frame{};
      if (guest->frames.decoder().feed(data, left, used, frame)) {
        pass_on(frame, send);
      }
      data += used;
      left -= used;
    }
  }
}

void LinkShare::pass_on(const proto::FrameView& frame,
                        const std::function<bool(const std::vector<std::uint8_t>&)>& send) {
  if (!may_go_up(frame)) {
    counters_.withheld += 1;
    return;
  }
  std::vector<std::uint8_t> framed(proto::frame_bound_bytes(frame.payload_bytes));
  framed.resize(
      proto::encode_frame(frame.payload, frame.payload_bytes, framed.data(), framed.size())
          .value());
  counters_.forwarded += send(framed) ? 1U : 0U;
}

}  // namespace leadline::host
