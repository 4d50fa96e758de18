// The codecs behind the drivers' names: one line each, and how a port's configuration becomes the codec's.
//
// A codec fits when it keeps the contract of hal/codec.hpp: constructible from its configuration,
// feed(byte, t, Record&), restart(), counters(); next(Record&) and request(now, out, capacity) where it has
// them. Record is base::Ping for a head and base::NavSample for a sensor. No destructor to be run, no pointer
// into itself.
//
// LEADLINE_DRIVERS (a number, bit n = driver n) leaves out what a vehicle does not carry: neither its code
// nor its storage is there. Without it every driver is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/drivers.hpp"
#include "hal/attitude/keller.hpp"
#include "hal/attitude/line.hpp"
#include "hal/attitude/mavlink.hpp"
#include "hal/attitude/nmea.hpp"
#include "hal/attitude/nmea2000.hpp"
#include "hal/attitude/pd0.hpp"
#include "hal/attitude/trax.hpp"
#include "hal/attitude/tss1.hpp"
#include "hal/attitude/vectornav.hpp"
#include "hal/attitude/wldvl.hpp"
#include "hal/attitude/xsens.hpp"
#include "hal/heads/cerulean.hpp"
#include "hal/heads/deltat83p.hpp"
#include "hal/heads/imagenex.hpp"
#include "hal/heads/kongsberg.hpp"
#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "hal/heads/r2sonic.hpp"
#include "hal/heads/tritech.hpp"
#include "hal/heads/wl3d.hpp"

#ifndef LEADLINE_DRIVERS
#define LEADLINE_DRIVERS 0xFFFFFFFFU
#endif

namespace leadline::firmware {

/// What a codec is told of the vehicle besides its port.
struct DeviceSetup {
  std::int32_t sound_speed_mm_s;
};

// The codec's configuration for a port. Its default-constructed one serves for decoding a file.
[[nodiscard]] hal::Ping1dConfig ping1d_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::Ping360Config ping360_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::NmeaConfig nmea_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::CeruleanConfig cerulean_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::ImagenexConfig imagenex_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::Deltat83pConfig deltat83p_config(const PortConfig& port,
                                                    const DeviceSetup& setup);
[[nodiscard]] hal::Tss1Config tss1_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::VectorNavConfig vectornav_config(const PortConfig& port,
                                                    const DeviceSetup& setup);
[[nodiscard]] hal::XsensConfig xsens_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::WlDvlConfig wldvl_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::Pd0Config pd0_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::KongsbergConfig kongsberg_config(const PortConfig& port,
                                                    const DeviceSetup& setup);
[[nodiscard]] hal::TritechConfig tritech_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::Wl3dConfig wl3d_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::TraxConfig trax_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::R2SonicConfig r2sonic_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::KellerConfig keller_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::Nmea2000Config nmea2000_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::MavlinkConfig mavlink_config(const PortConfig& port, const DeviceSetup& setup);
[[nodiscard]] hal::LineConfig line_config(const PortConfig& port, const DeviceSetup& setup);

template <Driver kDriverNumber, class CodecType, auto kConfigOf>
struct DriverEntry {
  static constexpr Driver kDriver = kDriverNumber;
  static constexpr bool kEnabled =
      ((LEADLINE_DRIVERS >> static_cast<unsigned>(kDriverNumber)) & 1U) != 0;
  using Codec = CodecType;
  using Config = decltype(kConfigOf(PortConfig{}, DeviceSetup{}));
  static Config config_of(const PortConfig& port, const DeviceSetup& setup) {
    return kConfigOf(port, setup);
  }
};

template <class... Entries>
struct DriverList {};

using DriverEntries =
    DriverList<DriverEntry<Driver::kPing1d, hal::Ping1dCodec, &ping1d_config>,
               DriverEntry<Driver::kPing360, hal::Ping360Codec, &ping360_config>,
               DriverEntry<Driver::kNmea, hal::NmeaCodec, &nmea_config>,
               DriverEntry<Driver::kCerulean, hal::CeruleanCodec, &cerulean_config>,
               DriverEntry<Driver::kImagenex, hal::ImagenexCodec, &imagenex_config>,
               DriverEntry<Driver::kDeltat83p, hal::Deltat83pCodec, &deltat83p_config>,
               DriverEntry<Driver::kKongsberg, hal::KongsbergCodec, &kongsberg_config>,
               DriverEntry<Driver::kTritech, hal::TritechCodec, &tritech_config>,
               DriverEntry<Driver::kWl3d, hal::Wl3dCodec, &wl3d_config>,
               DriverEntry<Driver::kTrax, hal::TraxCodec, &trax_config>,
               DriverEntry<Driver::kR2sonic, hal::R2SonicCodec, &r2sonic_config>,
               DriverEntry<Driver::kTss1, hal::Tss1Codec, &tss1_config>,
               DriverEntry<Driver::kVectornav, hal::VectorNavCodec, &vectornav_config>,
               DriverEntry<Driver::kXsens, hal::XsensCodec, &xsens_config>,
               DriverEntry<Driver::kWldvl, hal::WlDvlCodec, &wldvl_config>,
               DriverEntry<Driver::kPd0, hal::Pd0Codec, &pd0_config>,
               DriverEntry<Driver::kKeller, hal::KellerCodec, &keller_config>,
               DriverEntry<Driver::kNmea2000, hal::Nmea2000Codec, &nmea2000_config>,
               DriverEntry<Driver::kMavlink, hal::MavlinkCodec, &mavlink_config>,
               DriverEntry<Driver::kLine, hal::LineCodec, &line_config>>;

namespace detail {
constexpr std::size_t larger(std::size_t a, std::size_t b) { return a > b ? a : b; }

template <class... Entries>
constexpr std::size_t codec_bytes(DriverList<Entries...> /*list*/) {
  std::size_t most = 1;
  ((most = Entries::kEnabled ? larger(most, sizeof(typename Entries::Codec)) : most), ...);
  return most;
}

template <class... Entries>
constexpr std::size_t codec_alignment(DriverList<Entries...> /*list*/) {
  std::size_t most = 1;
  ((most = Entries::kEnabled ? larger(most, alignof(typename Entries::Codec)) : most), ...);
  return most;
}

template <class... Entries>
constexpr bool any_enabled(DriverList<Entries...> /*list*/, Driver driver) {
  return ((Entries::kEnabled && Entries::kDriver == driver) || ...);
}
}  // namespace detail

/// Room for the largest codec that is there.
inline constexpr std::size_t kCodecStorage_bytes = detail::codec_bytes(DriverEntries{});
inline constexpr std::size_t kCodecStorage_alignment = detail::codec_alignment(DriverEntries{});

// What a vehicle has for the codecs of all its ports together; a target overrides it from its build.
#ifndef LEADLINE_CODEC_BYTES
#define LEADLINE_CODEC_BYTES 2097152U  // four of a survey multibeam and four of others
#endif
/// Never more than eight of the largest, nor less than one.
inline constexpr std::size_t kCodecArena_bytes =
    detail::larger(kCodecStorage_bytes + kCodecStorage_alignment,
                   kMaxPorts*(kCodecStorage_bytes + kCodecStorage_alignment) < LEADLINE_CODEC_BYTES
                       ? kMaxPorts * (kCodecStorage_bytes + kCodecStorage_alignment)
                       : LEADLINE_CODEC_BYTES);

/// Whether this build carries the driver's codec.
[[nodiscard]] constexpr bool driver_enabled(Driver driver) {
  return detail::any_enabled(DriverEntries{}, driver);
}

}  // namespace leadline::firmware
