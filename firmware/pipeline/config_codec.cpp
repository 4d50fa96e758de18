#include "firmware/pipeline/config_codec.hpp"

#include <type_traits>

#include "model/base/crc32c.hpp"
#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Result;
using base::Status;

constexpr std::uint32_t kMagic = 0x31564C4CU;  // "LLV1" in file order
constexpr std::size_t kHeader_bytes = 4 + 2 + 2 + 4 + 4;

// The three things that are done with every field, in the one order that walk() knows.
struct Counter {
  std::size_t size = 0;
  template <typename T>
  void operator()(T& value) {
    size += sizeof(value);
  }
};

struct Writer {
  std::uint8_t* out;
  template <typename T>
  void operator()(T& value) {
    std::uint64_t bits = 0;
    if constexpr (sizeof(T) == 1) {
      bits = static_cast<std::uint8_t>(value);
    } else {
      bits = static_cast<std::uint64_t>(value);
    }
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      *out = static_cast<std::uint8_t>(bits & 0xFFU);
      bits >>= 8U;
      ++out;
    }
  }
};

struct Reader {
  const std::uint8_t* in;
  template <typename T>
  void operator()(T& value) {
    std::uint64_t bits = 0;
    for (std::size_t i = sizeof(T); i > 0; --i) {
      bits = (bits << 8U) | in[i - 1];
    }
    in += sizeof(T);
    if constexpr (std::is_enum_v<T>) {
      value = static_cast<T>(static_cast<std::underlying_type_t<T>>(bits));
    } else {
      value = static_cast<T>(bits);
    }
  }
};

template <typename Visit, typename T, std::size_t kCount>
void walk_array(Visit& visit, T (&values)[kCount]) {
  for (T& value : values) {
    visit(value);
  }
}

template <typename Visit>
void walk_model(Visit& visit, model::ModelConfig& config) {
  visit(config.schema_version);
  visit(config.rule);
  visit(config.k_p_q16);
  visit(config.no_return);
  visit(config.cell_mm);
  walk_array(visit, config.size);
  walk_array(visit, config.origin_mm);
  visit(config.min_range_um);
  visit(config.max_range_um);
  visit(config.detect_range_um);
  walk_array(visit, config.sigma_position_mm);
  walk_array(visit, config.sigma_correlated_mm);
  visit(config.work_budget_voxels);
}

template <typename Visit>
void walk_port(Visit& visit, PortConfig& port) {
  visit(port.driver);
  visit(port.mount);
  visit(port.switches);
  visit(port.latency_us);
  visit(port.min_range_um);
  visit(port.max_range_um);
  visit(port.ping_interval_us);
  visit(port.scan_first_grad);
  visit(port.scan_last_grad);
  visit(port.scan_step_grad);
  visit(port.profile);
  visit(port.gain_plus_1);
  visit(port.frequency_khz);
  visit(port.address);
  visit(port.variant_plus_1);
  visit(port.byte_time_ns);
  visit(port.intensity_scale);
  visit(port.intensity_step_mdb);
}

template <typename Visit>
void walk_mount(Visit& visit, MountConfig& mount) {
  walk_array(visit, mount.lever_arm_mm);
  visit(mount.boresight.roll_bam32);
  visit(mount.boresight.pitch_bam32);
  visit(mount.boresight.heading_bam32);
  visit(mount.table);
}

template <typename Visit>
void walk_navigation(Visit& visit, NavigationConfig& navigation) {
  visit(navigation.origin_latitude_e9deg);
  visit(navigation.origin_longitude_e9deg);
  visit(navigation.has_origin);
  visit(navigation.magnetic_variation_bam32);
  visit(navigation.surface_pressure_pa);
  visit(navigation.water_density_g_m3);
  visit(navigation.gravity_um_s2);
  visit(navigation.sigma_fix_mm);
  visit(navigation.sigma_depth_mm);
  visit(navigation.sigma_attitude_urad);
  visit(navigation.sigma_heading_urad);
  visit(navigation.acceleration_mm_s2);
  visit(navigation.angular_acceleration_urad_s2);
  visit(navigation.max_gap_us);
  visit(navigation.max_wait_us);
}

template <typename Visit>
void walk_water(Visit& visit, WaterConfig& water) {
  visit(water.speed_known);
  visit(water.point_count);
  for (SoundSpeedEntry& point : water.points) {
    visit(point.depth_mm);
    visit(point.speed_mm_s);
  }
  visit(water.tide_count);
  for (TidePoint& point : water.tide) {
    visit(point.t_us);
    visit(point.height_mm);
  }
}

template <typename Visit>
void walk(Visit& visit, VehicleConfig& config) {
  visit(config.schema_version);
  visit(config.port_count);
  visit(config.mount_count);
  visit(config.table_count);
  visit(config.survey_id);
  walk_model(visit, config.model);
  visit(config.epsg);
  visit(config.sound_speed_mm_s);
  visit(config.cycle_voxel_budget);
  visit(config.cycle_tile_budget);
  for (PortConfig& port : config.ports) {
    walk_port(visit, port);
  }
  for (MountConfig& mount : config.mounts) {
    walk_mount(visit, mount);
  }
  walk_navigation(visit, config.navigation);
  walk_water(visit, config.water);
  visit(config.link.rate_bytes_s);
  visit(config.link.mtu_bytes);
  visit(config.link.status_interval_us);
  visit(config.link.hello_interval_us);
  visit(config.link.max_tile_age_us);
  visit(config.session);
  walk_array(visit, config.survey_name);
  walk_array(visit, config.vertical_datum);
}

// What version 2 added, behind everything of version 1. Absent fields of a blob of version 1 are 0, which means
// what version 1 did.
template <typename Visit>
void walk_added_2(Visit& visit, VehicleConfig& config) {
  for (PortConfig& port : config.ports) {
    visit(port.max_returns);
    visit(port.quality_weight_percent);
  }
  visit(config.model.resident_tiles);
  visit(config.has_store);
}

template <typename Visit>
void walk_version(Visit& visit, VehicleConfig& config, std::uint16_t version) {
  walk(visit, config);
  if (version >= 2) {
    walk_added_2(visit, config);
  }
}

// What stands behind version 2, as far as something is not 0: without it a blob has the bytes, and the checksum, that
// it had before there was such a thing. The first `count` of these fields.
constexpr int kOptionalFields = 2;
template <typename Visit>
void walk_optional(Visit& visit, VehicleConfig& config, int count) {
  std::uint32_t* const fields[kOptionalFields] = {&config.extract_interval_us,
                                                  &config.link.coarse_wait_us};
  for (int i = 0; i < count; ++i) {
    visit(*fields[i]);
  }
}

int optional_count(const VehicleConfig& config, std::uint16_t version) {
  if (version < 2) {
    return 0;
  }
  if (config.link.coarse_wait_us != 0) {
    return 2;
  }
  return config.extract_interval_us != 0 ? 1 : 0;
}

std::size_t blob_bytes(std::uint16_t version, int optional) {
  Counter counter;
  VehicleConfig config{};
  walk_version(counter, config, version);
  walk_optional(counter, config, optional);
  return kHeader_bytes + counter.size;
}

// As the configuration was read: an old flight that is replayed says the same checksum of it.
std::uint16_t blob_version(const VehicleConfig& config) {
  return base::clamp<std::uint16_t>(config.schema_version, 1, kVehicleConfigSchemaVersion);
}

bool known_enumerators(const VehicleConfig& config) {
  for (const PortConfig& port : config.ports) {
    if (port.driver != Driver::kNone && driver_info(port.driver) == nullptr) {
      return false;
    }
    if (port.intensity_scale > IntensityScale::kDecibel) {
      return false;
    }
  }
  return config.model.rule <= model::Rule::kRecursive &&
         config.model.no_return <= model::NoReturnPolicy::kEmpty;
}

}  // namespace

std::size_t config_blob_bytes(const VehicleConfig& config) {
  const std::uint16_t version = blob_version(config);
  return blob_bytes(version, optional_count(config, version));
}

Result<std::size_t> encode_config(const VehicleConfig& config, std::uint8_t* out,
                                  std::size_t capacity_bytes) {
  std::uint16_t version = blob_version(config);
  const std::size_t size = config_blob_bytes(config);
  if (capacity_bytes < size) {
    return Status::kFull;
  }
  VehicleConfig copy = config;  // walk() serves reading as well, so it takes no const
  Writer body{out + kHeader_bytes};
  walk_version(body, copy, version);
  walk_optional(body, copy, optional_count(config, version));
  std::uint32_t magic = kMagic;
  std::uint16_t reserved = 0;
  auto size_bytes = static_cast<std::uint32_t>(size);
  std::uint32_t crc = base::crc32c(out + kHeader_bytes, size - kHeader_bytes);
  Writer header{out};
  header(magic);
  header(version);
  header(reserved);
  header(size_bytes);
  header(crc);
  return size;
}

Result<VehicleConfig> decode_config(const std::uint8_t* blob, std::size_t size_bytes) {
  if (blob == nullptr || size_bytes < kHeader_bytes) {
    return Status::kTruncated;
  }
  std::uint32_t magic = 0;
  std::uint16_t version = 0;
  std::uint16_t reserved = 0;
  std::uint32_t stated_bytes = 0;
  std::uint32_t crc = 0;
  Reader header{blob};
  header(magic);
  header(version);
  header(reserved);
  header(stated_bytes);
  header(crc);
  if (magic != kMagic) {
    return Status::kInvalidArgument;
  }
  if (version < 1 || version > kVehicleConfigSchemaVersion) {
    return Status::kBadVersion;
  }
  if (size_bytes < stated_bytes) {
    return Status::kTruncated;
  }
  int optional = version >= 2 ? kOptionalFields : 0;
  while (optional > 0 && stated_bytes != blob_bytes(version, optional)) {
    --optional;
  }
  if (size_bytes != stated_bytes || stated_bytes != blob_bytes(version, optional)) {
    return Status::kInvalidArgument;
  }
  if (base::crc32c(blob + kHeader_bytes, size_bytes - kHeader_bytes) != crc) {
    return Status::kBadChecksum;
  }
  VehicleConfig config{};
  Reader body{blob + kHeader_bytes};
  walk_version(body, config, version);
  walk_optional(body, config, optional);
  if (config.schema_version != version || !known_enumerators(config) ||
      optional != optional_count(config, version)) {
    return Status::kOutOfRange;
  }
  return config;
}

}  // namespace leadline::firmware
