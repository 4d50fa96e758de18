#include "hal/emu/wl_dvl.hpp"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <vector>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  std::va_list values;
  va_start(values, pattern);
  std::vector<char> text(2048);
  const int size = std::vsnprintf(text.data(), text.size(), pattern, values);
  va_end(values);
  return {text.data(), static_cast<std::size_t>(size)};
}

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

long long microseconds(const Motion& motion) { return std::llround(motion.time_s * 1e6); }

/// "vx,vy,vz,valid"
std::string velocities(const Motion& motion, const WlDvlState& state) {
  const auto& v = motion.velocity_m_s;
  return state.valid ? format("%.3f,%.3f,%.3f,y", v[0], v[1], v[2]) : "0.000,0.000,0.000,n";
}

/// "fom,covariance,validity,transmission,interval,status"
std::string tail(const Motion& motion, const WlDvlState& state) {
  return format("0.012,1e-04;0;0;0;1e-04;0;0;0;2e-05,%lld,%lld,125.00,0", microseconds(motion),
                microseconds(motion) + static_cast<long long>(state.delay_us));
}

double altitude(const Motion& motion, const WlDvlState& state) {
  return state.valid ? motion.altitude_m : -1.0;
}

long mm_s(double m_s) { return std::lround(m_s * 1000); }

}  // namespace

Bytes wldvl_line(const std::string& body) {
  const Bytes bytes = bytes_of(body);
  return bytes_of(body + format("*%02x\r\n", hal::crc8(bytes.data(), bytes.size())));
}

Bytes wldvl_velocity(const Motion& motion, const WlDvlState& state) {
  return wldvl_line("wrz," + velocities(motion, state) + format(",%.2f,", altitude(motion, state)) +
                    tail(motion, state));
}

Bytes wldvl_water(const Motion& motion, const WlDvlState& state) {
  return wldvl_line("wrs," + velocities(motion, state) + "," + tail(motion, state));
}

Bytes wldvl_old_velocity(const Motion& motion, const WlDvlState& state) {
  const auto& v = motion.velocity_m_s;
  return wldvl_line(format("wrx,125.00,%.3f,%.3f,%.3f,0.012,%.2f,%c,0", v[0], v[1], v[2],
                           altitude(motion, state), state.valid ? 'y' : 'n'));
}

Bytes wldvl_position(const Motion& motion, const WlDvlState& state) {
  const auto& p = motion.position_m;
  return wldvl_line(format("wrp,%.3f,%.2f,%.2f,%.2f,0.400,%.1f,%.1f,%.1f,%d", motion.time_s, p[0],
                           p[1], p[2], motion.roll_deg, motion.pitch_deg, motion.heading_deg,
                           state.valid ? 0 : 1));
}

Bytes wldvl_pd6(const Motion& motion, const WlDvlState& state) {
  const long x = mm_s(motion.velocity_m_s[0]);
  const long y = mm_s(motion.velocity_m_s[1]);
  const long z = mm_s(motion.velocity_m_s[2]);
  const char status = state.valid ? 'A' : 'V';
  std::string text =
      ":SA, +0.00, +0.00,  0.00\r\n:TS,26030212345678, 0.0, +0.0,   0.0,1475.0,  0\r\n"
      ":WI,    +0,    +0,    +0,    +0,V\r\n:WS,    +0,    +0,    +0,V\r\n"
      ":WE,    +0,    +0,    +0,V\r\n"
      ":WD,       +0.00,       +0.00,       +0.00,   0.00,  0.00\r\n";
  text += format(":BI,%+6ld,%+6ld,%+6ld,    +0,%c\r\n", x, y, z, status);
  text += format(":BS,%+6ld,%+6ld,%+6ld,%c\r\n:BE,    +0,    +0,    +0,V\r\n", y, x, z, status);
  text += format(":BD,       +0.00,       +0.00,       +0.00,%7.2f,  0.00\r\n",
                 state.valid ? motion.altitude_m : 0.0);
  return bytes_of(text);
}

Bytes wldvl_pd4(const Motion& motion, const WlDvlState& state) {
  ByteWriter frame(ByteOrder::kLittle);
  frame.u8(0x7D).u8(0).u16(47).u8(0xA3);
  for (const double v : motion.velocity_m_s) {
    frame.i16(state.valid ? mm_s(v) : -32768);
  }
  frame.i16(0);
  for (int beam = 0; beam < 4; ++beam) {
    frame.u16(state.valid ? static_cast<unsigned>(std::lround(motion.altitude_m * 100)) : 0);
  }
  frame.u8(state.valid ? 0 : 1).zeros(13).u8(12).u8(34).u8(56).u8(78).u16(0).u16(1475).u16(0);
  frame.u16(hal::sum16(frame.bytes().data(), frame.bytes().size()));
  return frame.bytes();
}

Bytes wldvl_json_velocity(const Motion& motion, const WlDvlState& state, const std::string& type) {
  const auto& v = motion.velocity_m_s;
  std::string text = format(
      "{\"time\":106.39,\"vx\":%.9g,\"vy\":%.9g,\"vz\":%.9g,\"fom\":0.012,\"covariance\":"
      "[[1e-04,0,0],[0,1e-04,0],[0,0,2e-05]],\"altitude\":%.9g,\"transducers\":[",
      v[0], v[1], v[2], altitude(motion, state));
  for (int id = 0; id < 4; ++id) {
    text += format(
        "%s{\"id\":%d,\"velocity\":0.1,\"distance\":%.9g,\"rssi\":-30.49,\"nsd\":-88.73,"
        "\"beam_valid\":%s}",
        id == 0 ? "" : ",", id, motion.altitude_m, state.valid ? "true" : "false");
  }
  text += format(
      "],\"velocity_valid\":%s,\"status\":0,\"format\":\"json_v3.1\",\"type\":\"%s\","
      "\"time_of_validity\":%lld,\"time_of_transmission\":%lld}\r\n",
      state.valid ? "true" : "false", type.c_str(), microseconds(motion),
      microseconds(motion) + static_cast<long long>(state.delay_us));
  return bytes_of(text);
}

Bytes wldvl_json_position(const Motion& motion, const WlDvlState& state) {
  const auto& p = motion.position_m;
  return bytes_of(format(
      "{\"ts\":%.6f,\"x\":%.9g,\"y\":%.9g,\"z\":%.9g,\"std\":0.4,\"roll\":%.9g,\"pitch\":%.9g,"
      "\"yaw\":%.9g,\"type\":\"position_local\",\"status\":%d,\"format\":\"json_v3.1\"}\n",
      motion.time_s, p[0], p[1], p[2], motion.roll_deg, motion.pitch_deg, motion.heading_deg,
      state.valid ? 0 : 1));
}

}  // namespace leadline::emu
