// The one vehicle of an image, and its place.
#include "firmware/pipeline/vehicle.hpp"

namespace leadline::firmware::m7 {

extern Vehicle the_vehicle;
[[gnu::section(".bss.leadline.vehicle")]] Vehicle the_vehicle;

}  // namespace leadline::firmware::m7
