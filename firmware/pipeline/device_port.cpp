#include "firmware/pipeline/device_port.hpp"

#include <new>
#include <type_traits>
#include <utility>

namespace leadline::firmware {
namespace {

const hal::CodecCounters& uniform(const hal::CodecCounters& counters) { return counters; }

hal::CodecCounters uniform(const hal::NmeaCounters& from) {
  hal::CodecCounters to{};
  to.frames = from.records + from.ignored + from.no_data + from.bad_field;
  to.records = from.records + from.no_data;
  to.ignored = from.ignored;
  to.no_data = from.no_data;
  to.bad_checksum = from.bad_checksum + from.no_checksum;
  to.bad_values = from.bad_field + from.bad_byte;
  to.bad_length = from.too_long;
  to.unfinished = from.unfinished;
  return to;
}

base::Ping& record_of(DeviceRecord& record, std::true_type /*head*/) { return record.ping; }
base::NavSample& record_of(DeviceRecord& record, std::false_type /*head*/) { return record.sample; }

// What not every codec has.
template <class Codec, class Record, class = void>
struct HasNext : std::false_type {};
template <class Codec, class Record>
struct HasNext<Codec, Record,
               std::void_t<decltype(std::declval<Codec&>().next(std::declval<Record&>()))>>
    : std::true_type {};

template <class Codec, class = void>
struct HasSamples : std::false_type {};
template <class Codec>
struct HasSamples<Codec, std::void_t<decltype(std::declval<Codec&>().take_sample(
                             std::declval<base::NavSample&>()))>> : std::true_type {};

template <class Codec, class = void>
struct HasFrame : std::false_type {};
template <class Codec>
struct HasFrame<Codec, std::void_t<decltype(std::declval<const Codec&>().frame())>>
    : std::true_type {};

template <class Codec, class = void>
struct HasRequest : std::false_type {};
template <class Codec>
struct HasRequest<Codec, std::void_t<decltype(std::declval<Codec&>().request(
                             base::TimeUs{}, std::declval<std::uint8_t*>(), std::size_t{}))>>
    : std::true_type {};

// What decoding a file asks of a codec otherwise than its defaults, which serve a live device: every
// measurement in it counts, near and far, and none is the answer to a request repeated.
template <class Config>
Config for_decoding(const Config& config) {
  return config;
}
hal::Ping1dConfig for_decoding(hal::Ping1dConfig config) {
  config.drop_repeats = false;
  config.every_range = true;
  config.min_range_um = 0;
  config.max_range_um = 300'000'000;
  return config;
}
[[maybe_unused]] hal::WlDvlConfig for_decoding(hal::WlDvlConfig config) {
  config.drop_repeats = false;
  config.every_report = true;
  return config;
}
[[maybe_unused]] hal::VectorNavConfig for_decoding(hal::VectorNavConfig config) {
  config.every_report = true;
  return config;
}
[[maybe_unused]] hal::XsensConfig for_decoding(hal::XsensConfig config) {
  config.use_pressure = true;
  return config;
}
[[maybe_unused]] hal::KellerConfig for_decoding(hal::KellerConfig config) {
  config.bus = hal::KellerBus::kEither;
  config.address = 0;
  return config;
}
hal::Ping360Config for_decoding(hal::Ping360Config config) {
  config.min_range_um = 0;
  config.max_range_um = 300'000'000;
  return config;
}

/// The calls of one entry's codec.
template <class Entry>
struct Calls {
  using Codec = typename Entry::Codec;
  using IsHead = std::bool_constant<is_head(Entry::kDriver)>;
  using Record = std::conditional_t<IsHead::value, base::Ping, base::NavSample>;
  static constexpr RecordKind kKind = IsHead::value ? RecordKind::kPing : RecordKind::kSample;
  static_assert(std::is_trivially_destructible_v<Codec>, "nobody destroys a port's codec");

  static Codec& of(void* codec) { return *static_cast<Codec*>(codec); }

  static void* make(void* storage, const PortConfig& port, const DeviceSetup& setup) {
    // NOLINTBEGIN(cppcoreguidelines-owning-memory): the port owns the storage
    // house: begin allow new: constructs in the port's own storage, no heap
    return ::new (storage) Codec(Entry::config_of(port, setup));
    // house: end allow
    // NOLINTEND(cppcoreguidelines-owning-memory)
  }
  static void* make_default(void* storage) {
    // NOLINTBEGIN(cppcoreguidelines-owning-memory): the port owns the storage
    // house: begin allow new: constructs in the port's own storage, no heap
    return ::new (storage) Codec(for_decoding(typename Entry::Config{}));
    // house: end allow
    // NOLINTEND(cppcoreguidelines-owning-memory)
  }
  static RecordKind feed(void* codec, std::uint8_t byte, base::TimeUs t_arrival_us,
                         DeviceRecord& record) {
    return of(codec).feed(byte, t_arrival_us, record_of(record, IsHead{})) ? kKind
                                                                           : sample(codec, record);
  }
  static RecordKind next(void* codec, DeviceRecord& record) {
    if constexpr (HasNext<Codec, Record>::value) {
      if (of(codec).next(record_of(record, IsHead{}))) {
        return kKind;
      }
    }
    return sample(codec, record);
  }
  /// What a head knows of the vehicle (hal/heads/nav_queue.hpp): behind its pings.
  static RecordKind sample(void* codec, DeviceRecord& record) {
    if constexpr (HasSamples<Codec>::value) {
      return of(codec).take_sample(record.sample) ? RecordKind::kSample : RecordKind::kNone;
    } else {
      static_cast<void>(codec);
      static_cast<void>(record);
      return RecordKind::kNone;
    }
  }
  static std::size_t request(void* codec, base::TimeUs now_us, std::uint8_t* out,
                             std::size_t capacity) {
    if constexpr (HasRequest<Codec>::value) {
      return of(codec).request(now_us, out, capacity);
    } else {
      static_cast<void>(codec);
      static_cast<void>(now_us);
      static_cast<void>(out);
      static_cast<void>(capacity);
      return 0;
    }
  }
  static void restart(void* codec) { of(codec).restart(); }
  static hal::CodecCounters counters(const void* codec) {
    return uniform(static_cast<const Codec*>(codec)->counters());
  }
  static hal::FrameView frame(const void* codec) {
    if constexpr (HasFrame<Codec>::value) {
      return static_cast<const Codec*>(codec)->frame();
    } else {
      static_cast<void>(codec);
      return {nullptr, 0};
    }
  }

  static constexpr DeviceCodec kTable = {Entry::kDriver, sizeof(Codec), &make,    &make_default,
                                         &feed,          &next,         &request, &restart,
                                         &counters,      &frame};
};

template <class Entry>
void consider(Driver driver, const DeviceCodec*& found) {
  if constexpr (Entry::kEnabled) {
    if (driver == Entry::kDriver) {
      found = &Calls<Entry>::kTable;
    }
  }
}

template <class... Entries>
const DeviceCodec* find_codec(DriverList<Entries...> /*list*/, Driver driver) {
  const DeviceCodec* found = nullptr;
  (consider<Entries>(driver, found), ...);
  return found;
}

}  // namespace

const DeviceCodec* device_codec(Driver driver) { return find_codec(DriverEntries{}, driver); }

void* CodecArena::take(std::size_t size_bytes) {
  const std::size_t size = rounded(size_bytes);
  if (size > capacity_bytes_ - used_bytes_) {
    return nullptr;
  }
  void* const room = bytes_ + used_bytes_;
  used_bytes_ += size;
  return room;
}

// Adopts the driver's calls and takes room for its object; null, and no driver, where there is neither.
void* PortCodec::room_for(Driver driver, CodecArena& arena) {
  codec_ = device_codec(driver);
  void* const room = codec_ != nullptr ? arena.take(codec_->size_bytes) : nullptr;
  codec_ = room != nullptr ? codec_ : nullptr;
  return room;
}

void PortCodec::configure(const PortConfig& config, const DeviceSetup& setup, CodecArena& arena) {
  void* const room = room_for(config.driver, arena);
  object_ = codec_ != nullptr ? codec_->make(room, config, setup) : nullptr;
}

bool PortCodec::configure_decoding(Driver driver, CodecArena& arena) {
  void* const room = room_for(driver, arena);
  object_ = codec_ != nullptr ? codec_->make_default(room) : nullptr;
  return codec_ != nullptr;
}

RecordKind PortCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, DeviceRecord& record) {
  return codec_ != nullptr ? codec_->feed(object_, byte, t_arrival_us, record) : RecordKind::kNone;
}

RecordKind PortCodec::next(DeviceRecord& record) {
  return codec_ != nullptr ? codec_->next(object_, record) : RecordKind::kNone;
}

std::size_t PortCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  return codec_ != nullptr ? codec_->request(object_, now_us, out, capacity) : 0;
}

void PortCodec::restart() {
  if (codec_ != nullptr) {
    codec_->restart(object_);
  }
}

hal::CodecCounters PortCodec::counters() const {
  return codec_ != nullptr ? codec_->counters(object_) : hal::CodecCounters{};
}

hal::FrameView PortCodec::frame() const {
  return codec_ != nullptr ? codec_->frame(object_) : hal::FrameView{nullptr, 0};
}

}  // namespace leadline::firmware
