// A link lent to others of this user: what they get, what of theirs goes up, and who does not get in.
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

#include "firmware/keys/command_key.hpp"
#include "hal/linux/local_socket.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/topside/command_sender.hpp"
#include "host_tools/topside/link_share.hpp"
#include "host_tools/topside/receiver.hpp"
#include "proto/commands.hpp"
#include "proto/messages.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::hal::connect_local;
using leadline::host::CommandKey;
using leadline::host::CommandSender;
using leadline::host::HostError;
using leadline::host::LinkShare;
using leadline::test::Random;
using Bytes = std::vector<std::uint8_t>;
namespace proto = leadline::proto;

/// A folder with a socket's name in it.
struct Place {
  Place() {
    char name[] = "/tmp/leadline-share.XXXXXX";
    assert_non_null(::mkdtemp(name));
    folder = name;
    path = folder + "/socket";
  }
  ~Place() {
    ::unlink(path.c_str());
    ::rmdir(folder.c_str());
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  std::string folder;
  std::string path;
};

/// A program at the other end.
struct Guest {
  explicit Guest(const std::string& path) : fd(connect_local(path)) { assert_true(fd >= 0); }
  ~Guest() { ::close(fd); }
  Guest(const Guest&) = delete;
  Guest& operator=(const Guest&) = delete;
  void say(const Bytes& bytes) const {
    assert_int_equal(::write(fd, bytes.data(), bytes.size()), bytes.size());
  }
  [[nodiscard]] Bytes hear() const {
    Bytes bytes(65536);
    const ssize_t got = ::read(fd, bytes.data(), bytes.size());
    bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return bytes;
  }
  /// Whether the other end has hung up.
  [[nodiscard]] bool alone() const {
    std::uint8_t byte = 0;
    return ::read(fd, &byte, 1) == 0;
  }
  int fd;
};

Bytes framed(const Bytes& payload) {
  Bytes frame(proto::frame_bound_bytes(payload.size()));
  frame.resize(
      proto::encode_frame(payload.data(), payload.size(), frame.data(), frame.size()).value());
  return frame;
}

Bytes command_frame() {
  proto::Command command{};
  command.kind = proto::CommandKind::kStop;
  return CommandSender(CommandKey::random(3), command, 1).frame();
}

/// What the share sends up in some rounds.
Bytes sent_up(LinkShare* share, bool room = true) {
  const leadline::host::Receiver nothing;
  Bytes up;
  for (int round = 0; round < 8; ++round) {
    share->serve(
        [&](const Bytes& frame) {
          if (room) {
            up.insert(up.end(), frame.begin(), frame.end());
          }
          return room;
        },
        nothing);
  }
  return up;
}

void assert_refused(const std::string& path, const char* words) {
  std::string why;
  try {
    const LinkShare share(path);
  } catch (const HostError& error) {
    why = error.what();
  }
  assert_true(why.find(words) != std::string::npos);
}

TEST(commands_go_up_and_everything_comes_down) {
  const Place place;
  LinkShare share(place.path);
  const Guest one(place.path);
  const Guest two(place.path);
  assert_true(sent_up(&share).empty());
  const Bytes down = framed({1, 2, 3});
  share.give(down.data(), down.size());
  assert_true(one.hear() == down);
  assert_true(two.hear() == down);
  // In pieces, behind noise: the frame as it was.
  const Bytes command = command_frame();
  two.say({9, 9, 9});
  two.say(Bytes(command.begin(), command.begin() + 10));
  assert_true(sent_up(&share).empty());
  two.say(Bytes(command.begin() + 10, command.end()));
  assert_true(sent_up(&share) == command);
  std::uint8_t request[proto::kHelloRequest_bytes];
  const auto size = proto::encode_hello_request(request, sizeof request);
  const Bytes hello_request = framed(Bytes(request, request + size.value()));
  one.say(hello_request);
  assert_true(sent_up(&share) == hello_request);
  one.say(command);
  assert_true(sent_up(&share, false).empty());
  assert_int_equal(share.counters().forwarded, 2);
  assert_int_equal(share.counters().withheld, 0);
}

TEST(nothing_else_goes_up) {
  const Place place;
  LinkShare share(place.path);
  const Guest guest(place.path);
  std::uint64_t others = 0;
  for (int type = 0; type < 256; ++type) {
    if (type == static_cast<int>(proto::MessageType::kCommand) ||
        type == static_cast<int>(proto::MessageType::kHelloRequest)) {
      continue;
    }
    guest.say(framed(Bytes(20, static_cast<std::uint8_t>(type))));
    others += 1;
  }
  // Too long for any command; and an empty frame.
  guest.say(framed(Bytes(proto::kMaxCommand_bytes + 1,
                         static_cast<std::uint8_t>(proto::MessageType::kCommand))));
  guest.say(framed({}));
  assert_true(sent_up(&share).empty());
  assert_int_equal(share.counters().withheld, others + 2);
  // Noise makes no frame.
  Random random(7);
  for (int k = 0; k < 200; ++k) {
    Bytes noise(512);
    for (std::uint8_t& byte : noise) {
      byte = static_cast<std::uint8_t>(random.next());
    }
    guest.say(noise);
    assert_true(sent_up(&share).empty());
  }
  guest.say(framed({}));  // ends what the noise began
  guest.say(command_frame());
  assert_false(sent_up(&share).empty());
}

/// A vehicle's map on its way: hello and tile packets, as they come.
struct Survey {
  explicit Survey(std::uint64_t survey_id) {
    hello.protocol_major = proto::kProtocolMajor;
    hello.protocol_minor = proto::kProtocolMinor;
    hello.schema_hash = proto::schema_hash();
    hello.tile_side_cells = proto::kTileSide_cells;
    hello.survey_id = survey_id;
    hello.session = 3;
    hello.cell_mm = 500;
    hello.size_cells[0] = hello.size_cells[1] = kSide_cells;
    hello.size_cells[2] = 64;
    cells.resize(kTiles * proto::kTileArea_cells);
    generation.resize(kTiles);
  }
  [[nodiscard]] Bytes hello_frame() const {
    Bytes payload(proto::kMaxHello_bytes);
    payload.resize(proto::encode_hello(hello, payload.data(), payload.size()).value());
    return framed(payload);
  }
  /// Some cells of a tile change, one of them to unknown.
  Bytes change(std::uint32_t tile, Random* random) {
    proto::CodedCell* const own = &cells[tile * proto::kTileArea_cells];
    proto::CellMask changed{};
    for (int k = 0; k < 60; ++k) {
      const auto cell = static_cast<int>(random->between(0, proto::kTileArea_cells - 1));
      own[cell] =
          k == 0 ? proto::kUnknownCell
                 : proto::code_cell(static_cast<std::int32_t>(random->between(0, 15000)), 2048, 0);
      changed.set(cell);
    }
    generation[tile] += 1;
    Bytes payload(proto::kMaxPayload_bytes);
    proto::CellMask taken{};
    payload.resize(proto::encode_tile({tile, generation[tile], own, changed},
                                      proto::survey_tag(hello.survey_id, hello.session),
                                      payload.data(), payload.size(), taken)
                       .value());
    return framed(payload);
  }
  /// All of a tile, as an answer to a resend request.
  [[nodiscard]] Bytes whole(std::uint32_t tile) const {
    proto::CellMask all{};
    std::fill(std::begin(all.rows), std::end(all.rows), UINT16_MAX);
    Bytes payload(proto::kMaxPayload_bytes);
    proto::CellMask taken{};
    payload.resize(
        proto::encode_tile({tile, generation[tile], &cells[tile * proto::kTileArea_cells], all},
                           proto::survey_tag(hello.survey_id, hello.session), payload.data(),
                           payload.size(), taken)
            .value());
    return framed(payload);
  }

  static constexpr std::int32_t kSide_cells = 320;
  static constexpr std::uint32_t kTiles = (kSide_cells / 16) * (kSide_cells / 16);
  proto::Hello hello{};
  std::vector<proto::CodedCell> cells;
  std::vector<std::uint32_t> generation;
};

/// The program that has the link, and what it hears and lends.
struct Holder {
  explicit Holder(const std::string& path) : share(path) {}
  void hear(const Bytes& down) {
    share.give(down.data(), down.size());
    receiver.feed(down.data(), down.size());
  }
  void round() {
    share.serve([](const Bytes&) { return true; }, receiver);
  }
  LinkShare share;
  leadline::host::Receiver receiver;
};

/// Rounds until nothing comes any more.
void catch_up(Holder* holder, const Guest& guest, leadline::host::Receiver* receiver) {
  for (int quiet = 0; quiet < 3;) {
    holder->round();
    const Bytes bytes = guest.hear();
    receiver->feed(bytes.data(), bytes.size());
    quiet = bytes.empty() ? quiet + 1 : 0;
  }
}

TEST(who_comes_late_gets_the_map_that_is_there) {
  const Place place;
  Holder holder(place.path);
  Random random(11);
  Survey survey(5);
  const Guest early(place.path);
  leadline::host::Receiver heard;
  holder.hear(survey.hello_frame());
  for (std::uint32_t tile = 0; tile < Survey::kTiles; ++tile) {
    holder.hear(survey.change(tile, &random));
    if (tile % 50 == 0) {
      catch_up(&holder, early, &heard);
    }
  }
  (void)survey.change(7, &random);  // is lost: what the next one says of the tile is not all
  const Bytes late_word = survey.change(7, &random);
  holder.hear(survey.change(7, &random));
  assert_int_equal(holder.receiver.store()->tiles_incomplete(), 1);
  // Far more than what he may have to read at a time; and the vehicle goes on.
  const Guest late(place.path);
  leadline::host::Receiver caught_up;
  for (std::uint32_t tile = 0; tile < Survey::kTiles; tile += 3) {  // all but the seventh
    holder.round();
    const Bytes bytes = late.hear();
    caught_up.feed(bytes.data(), bytes.size());
    holder.hear(survey.change(tile, &random));
  }
  catch_up(&holder, late, &caught_up);
  assert_true(caught_up.store()->cells_hash() == holder.receiver.store()->cells_hash());
  assert_true(caught_up.counters().malformed == 0 && caught_up.counters().damaged_frames == 0);
  // An older word overtaken by a newer one, then what was missing.
  holder.hear(late_word);
  holder.hear(survey.whole(7));
  assert_int_equal(holder.receiver.store()->tiles_incomplete(), 0);
  catch_up(&holder, late, &caught_up);
  catch_up(&holder, early, &heard);
  assert_int_equal(caught_up.store()->tiles_incomplete(), 0);
  assert_true(caught_up.store()->cells_hash() == holder.receiver.store()->cells_hash());
  assert_true(heard.store()->cells_hash() == holder.receiver.store()->cells_hash());
  assert_int_equal(holder.share.counters().cut_off, 0);
  // Everything once, but for the tile that was not whole.
  assert_true(holder.share.counters().handed_tiles <= Survey::kTiles + 2 + 51);
  // Another map: he hears it from its beginning.
  Survey next(6);
  holder.hear(next.hello_frame());
  holder.hear(next.change(3, &random));
  catch_up(&holder, late, &caught_up);
  assert_int_equal(caught_up.store()->hello().survey_id, 6);
  assert_true(caught_up.store()->cells_hash() == holder.receiver.store()->cells_hash());
}

// What the holder shows besides the map: the coarse cells that still stand in, and the last status as briefs have changed it.
TEST(who_comes_late_sees_coarse_cells_and_the_status) {
  const Place place;
  Holder holder(place.path);
  Random random(13);
  const Survey survey(5);
  Survey speaker(5);
  const std::uint16_t tag = proto::survey_tag(survey.hello.survey_id, survey.hello.session);
  holder.hear(survey.hello_frame());
  // Three coarse tiles of 25; the one in the corner reaches over the grid by none of its cells.
  for (const std::uint32_t coarse_id : {0U, 7U, 24U}) {
    proto::CodedCell cells[proto::kTileArea_cells] = {};
    proto::CellMask known{};
    for (int cell = 0; cell < proto::kTileArea_cells; ++cell) {
      if (cell % 3 != 0) {
        cells[cell] =
            proto::code_cell(static_cast<std::int32_t>(random.between(100, 9000)), 2048, 0);
        known.set(cell);
      }
    }
    Bytes payload(proto::kMaxPayload_bytes);
    proto::TilePacketEncoder packet(payload.data(), payload.size(), tag, proto::TileScale::kCoarse);
    proto::CellMask taken{};
    assert_true(packet.add({coarse_id, 0, cells, known}, taken).ok());
    payload.resize(packet.finish());
    holder.hear(framed(payload));
  }
  proto::Status status{};
  status.work_bound_voxels = 4321;
  status.tiles_known = 40;
  status.port_count = 2;
  status.ports[1].records = 17;
  Bytes payload(proto::kMaxStatus_bytes);
  payload.resize(proto::encode_status(status, payload.data(), payload.size()).value());
  holder.hear(framed(payload));
  status.alarms = proto::kAlarmNoPose;
  status.tiles_known = 41;
  payload.resize(proto::kMaxBrief_bytes);
  payload.resize(
      proto::encode_brief(proto::brief_of(status), payload.data(), payload.size()).value());
  holder.hear(framed(payload));
  // One tile came whole, of another a part.
  (void)speaker.change(1, &random);
  holder.hear(speaker.whole(1));
  (void)speaker.change(2, &random);
  holder.hear(speaker.change(2, &random));
  const auto& shown = holder.receiver.coarse();
  assert_int_equal(shown.tiles(), 3 * 16 - 1);

  const Guest late(place.path);
  leadline::host::Receiver guest;
  catch_up(&holder, late, &guest);
  assert_int_equal(guest.counters().malformed + guest.counters().damaged_frames, 0);
  assert_int_equal(guest.coarse().tiles(), shown.tiles());
  for (const std::uint32_t tile : shown.changed_since(0)) {
    assert_non_null(guest.coarse().tile(tile));
    assert_true(*guest.coarse().tile(tile) == *shown.tile(tile));
  }
  assert_null(guest.coarse().tile(1));
  assert_non_null(guest.coarse().tile(2));  // stands in for what is missing of it
  assert_int_equal(guest.store()->tiles_incomplete(), 1);
  assert_true(guest.store()->cells_hash() == holder.receiver.store()->cells_hash());
  assert_true(guest.status().has_value());
  assert_int_equal(guest.status()->work_bound_voxels, 4321);
  assert_int_equal(guest.status()->tiles_known, 41);
  assert_int_equal(guest.status()->ports[1].records, 17);
  assert_int_equal(guest.status()->alarms, proto::kAlarmNoPose);
  // Once.
  const std::uint64_t statuses = guest.counters().statuses;
  catch_up(&holder, late, &guest);
  assert_int_equal(guest.counters().statuses, statuses);
}

TEST(a_map_that_comes_from_a_store_is_handed_out_too) {
  const Place place;
  Holder holder(place.path);
  Random random(12);
  Survey survey(5);
  leadline::host::Receiver before;
  const Bytes hello = survey.hello_frame();
  before.feed(hello.data(), hello.size());
  for (std::uint32_t tile = 0; tile < 9; ++tile) {
    const Bytes change = survey.change(tile, &random);
    before.feed(change.data(), change.size());
  }
  holder.receiver.on_begun = [&before](leadline::host::TileStore& begun) {
    for (std::uint32_t id = 0; id < 9; ++id) {
      const auto tile = before.store()->tile(id);
      leadline::host::StoredTile stored;
      stored.tile = id;
      stored.generation = tile->generation;
      stored.hash32 = tile->hash32;
      std::copy_n(tile->cells, proto::kTileArea_cells, stored.cells);
      assert_true(begun.restore(stored));
    }
  };
  // He is there before the map is.
  const Guest guest(place.path);
  leadline::host::Receiver receiver;
  catch_up(&holder, guest, &receiver);
  assert_null(receiver.store());
  holder.hear(hello);
  catch_up(&holder, guest, &receiver);
  assert_true(receiver.store()->cells_hash() == before.store()->cells_hash());
  assert_int_equal(holder.share.counters().handed_tiles, 9);
  // The same for the map after it.
  holder.hear(Survey(6).hello_frame());
  catch_up(&holder, guest, &receiver);
  assert_int_equal(receiver.store()->hello().survey_id, 6);
  assert_int_equal(receiver.store()->known_tiles(), 9);
  assert_int_equal(holder.share.counters().handed_tiles, 18);
}

// More than the socket takes, and he reads nothing for a while: he gets it when he does.
TEST(a_map_is_handed_out_as_it_is_read) {
  const Place place;
  Holder holder(place.path);
  Random random(14);
  Survey survey(5);
  holder.hear(survey.hello_frame());
  for (proto::CodedCell& cell : survey.cells) {
    cell = proto::code_cell(static_cast<std::int32_t>(random.between(0, 400'000)), 16, 0);
  }
  for (std::uint32_t tile = 0; tile < Survey::kTiles; ++tile) {
    survey.generation[tile] = 1;
    holder.hear(survey.whole(tile));
  }
  assert_true(holder.receiver.counters().bytes > 200'000);
  const Guest guest(place.path);
  for (int round = 0; round < 200; ++round) {
    holder.round();
  }
  leadline::host::Receiver receiver;
  catch_up(&holder, guest, &receiver);
  assert_true(receiver.store()->cells_hash() == holder.receiver.store()->cells_hash());
  assert_int_equal(holder.share.counters().handed_tiles, Survey::kTiles);
}

TEST(only_this_user_gets_in_and_only_so_many) {
  const Place place;
  LinkShare share(place.path);
  struct stat info {};
  assert_int_equal(::stat(place.path.c_str(), &info), 0);
  assert_int_equal(info.st_mode & 07777U, 0600);
  std::vector<std::unique_ptr<Guest>> guests;
  for (std::size_t i = 0; i < LinkShare::kMostGuests; ++i) {
    guests.push_back(std::make_unique<Guest>(place.path));
  }
  (void)sent_up(&share);
  const Guest late(place.path);
  (void)sent_up(&share);
  assert_true(late.alone());
  assert_int_equal(share.counters().refused, 1);
  guests.pop_back();
  (void)sent_up(&share);
  const Guest later(place.path);
  (void)sent_up(&share);
  assert_int_equal(share.counters().joined, LinkShare::kMostGuests + 1);
  later.say(command_frame());
  assert_false(sent_up(&share).empty());
}

TEST(nobody_waits_for_a_guest_that_does_not_read) {
  const Place place;
  LinkShare share(place.path);
  const Guest asleep(place.path);
  const Guest awake(place.path);
  (void)sent_up(&share);
  const Bytes down(16384, 5);
  for (int k = 0; k < 200; ++k) {
    share.give(down.data(), down.size());
    assert_int_equal(awake.hear().size(), down.size());
  }
  assert_int_equal(share.counters().cut_off, 1);
}

TEST(a_place_that_is_taken_is_said_and_a_dead_one_is_used_again) {
  const Place place;
  {
    std::ofstream(place.path) << "a file";
    assert_refused(place.path, "in use");
    assert_int_equal(::unlink(place.path.c_str()), 0);
  }
  {
    const LinkShare share(place.path);
    assert_refused(place.path, "in use");
  }
  assert_int_equal(::access(place.path.c_str(), F_OK), -1);
  {
    // What a program that was killed leaves.
    const std::string aside = place.folder + "/aside";
    {
      const LinkShare left(place.path);
      assert_int_equal(::rename(place.path.c_str(), aside.c_str()), 0);
    }
    assert_int_equal(::rename(aside.c_str(), place.path.c_str()), 0);
    const LinkShare share(place.path);
    const Guest guest(place.path);
  }
  assert_refused(place.folder + "/" + std::string(120, 'x'), "1 to 107 bytes");
}

}  // namespace
