// What a device states in a frame beside what navigation and model take of it (base::NavSample, base::Ping): read
// from the frame's bytes for whoever looks at a recording. The vehicle knows nothing of it.
//
// driver    | keys; null where the message has a place for it and the device says nothing
// ----------|---------------------------------------------------------------------------------------------
// nmea      | sentence (talker and type). HDG: deviation_deg, variation_deg (east positive). DPT:
//           | transducer_offset_m (positive to the surface, negative to the keel), max_range_m. PASHR: heave_m
//           | (as the sensor counts it), gps_quality, ins_status
// nmea2000  | pgn, source, priority; sequence_id (SID) where the message has one. 127250: deviation_deg,
//           | variation_deg. 128267: transducer_offset_m, max_range_m
// tss1      | horizontal_acceleration_m_s2, heave_acceleration_m_s2, status (U G H F, lower case: settling);
//           | roll_deg as the sensor states it (athwartships axis off level), euler_roll_deg as the vehicle takes it
// vectornav | $VNYMR: magnetic_field_gauss, acceleration_m_s2 (x, y, z). $VNRRG: record "register", its number
//           | and its values as text
// wldvl     | wrz, wrs, wrx, JSON: fom_m_s, status, and where it is in the report covariance_m2_s2 (nine, by rows),
//           | time_of_validity_us, time_of_transmission_us, interval_ms. wrp, JSON position: yaw_deg (about the axes
//           | at its reset, as its position), status. PD6, PD4: velocity_error_m_s. wru, wrt: record "beams", and
//           | JSON velocity, a list entry a beam: beam, beam_velocity_m_s, beam_distance_m, beam_rssi_dbm,
//           | beam_nsd_dbm
// ping1d    | confidence_percent; where it is in the message transmit_duration_us, ping_number, scan_start_mm,
//           | scan_length_mm, gain_setting; of a profile samples, first_sample_mm, sample_mm
#pragma once

#include <nlohmann/json.hpp>

#include "firmware/pipeline/drivers.hpp"
#include "hal/codec.hpp"

namespace leadline::host {

/// Adds to the record that was made of `frame`. Nothing for other drivers, and without a frame. O(frame).
void add_frame_values(firmware::Driver driver, const hal::FrameView& frame,
                      nlohmann::ordered_json* record);

}  // namespace leadline::host
