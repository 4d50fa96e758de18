// PD0 recordings (.pd0, .enx, .enr, .000) as a survey: the four slanted beams that follow the bottom are the
// sonar; the velocity over ground that the same beams make, the instrument's compass and tilts, and the GGA sentences
// that a recorder put into the ensembles are the navigation, through the vehicle's own filter
// (estimator/navigator.hpp). Without a GGA the track is dead reckoned from latitude 0, longitude 0, where nobody is:
// then its shape counts, not its place. A fix counts at the time of the ensemble that it stands in.
//
// A beam that looks along v (unit, forward, right, down; from the leader's beam angle, head and alignment, by the
// equations of hal/attitude/pd0.hpp) and says the vertical range h has its bottom at h / cos(angle) along v. Beams
// without a range, ensembles without a date and those of an instrument that looks up are counted and left.
//
// The compass is magnetic: where the recorder put in a VTG with both courses, their difference is the variation that
// turns it to true north; otherwise it is left as it is. Its deviation stays.
#pragma once

#include <string>

#include "host_tools/import/survey.hpp"

namespace leadline::host {

/// Throws HostError kInput: cannot be read, no ensemble with a bottom. Counts go to `notice`.
[[nodiscard]] SurveyLine read_pd0_line(const std::string& path, std::string* notice);

}  // namespace leadline::host
