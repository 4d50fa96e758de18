// Pictures: colour maps, display filters, shading, contours, page parts, and what every picture draws.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/render/canvas.hpp"
#include "host_tools/render/contour.hpp"
#include "host_tools/render/figure.hpp"
#include "host_tools/render/render.hpp"
#include "host_tools/render/surface.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;
namespace render = leadline::host::render;

using leadline::host::ExitCode;
using leadline::host::kNoValue;
using leadline::host::make_raster;
using leadline::host::Raster;
using leadline::test::assert_contains;
using leadline::test::error_of;
using render::Colour;
using render::ColourMap;
using render::OkLab;
using render::PictureOptions;
using render::VoxelAxis;
using render::VoxelField;

/// A PNG read back through cairo.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> pixels;  // 0xXXRRGGBB

  [[nodiscard]] Colour at(int x, int y) const {
    const std::uint32_t p = pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                   static_cast<std::size_t>(x)];
    return {static_cast<double>(p >> 16U & 255U) / 255.0,
            static_cast<double>(p >> 8U & 255U) / 255.0, static_cast<double>(p & 255U) / 255.0};
  }
};

cairo_status_t take_bytes(void* closure, unsigned char* data, unsigned int length) {
  auto* rest = static_cast<std::string_view*>(closure);
  if (rest->size() < length) {
    return CAIRO_STATUS_READ_ERROR;
  }
  std::memcpy(data, rest->data(), length);
  rest->remove_prefix(length);
  return CAIRO_STATUS_SUCCESS;
}

Picture read_png(const std::string& bytes) {
  std::string_view rest = bytes;
  cairo_surface_t* surface = cairo_image_surface_create_from_png_stream(take_bytes, &rest);
  assert_int_equal(cairo_surface_status(surface), CAIRO_STATUS_SUCCESS);
  Picture picture;
  picture.width = cairo_image_surface_get_width(surface);
  picture.height = cairo_image_surface_get_height(surface);
  const int stride = cairo_image_surface_get_stride(surface);
  const unsigned char* data = cairo_image_surface_get_data(surface);
  picture.pixels.resize(static_cast<std::size_t>(picture.width) *
                        static_cast<std::size_t>(picture.height));
  for (int row = 0; row < picture.height; ++row) {
    std::memcpy(picture.pixels.data() +
                    static_cast<std::size_t>(row) * static_cast<std::size_t>(picture.width),
                data + static_cast<std::ptrdiff_t>(row) * stride,
                static_cast<std::size_t>(picture.width) * 4);
  }
  cairo_surface_destroy(surface);
  return picture;
}

double difference(const Colour& a, const Colour& b) {
  return std::max(
      {std::fabs(a.red - b.red), std::fabs(a.green - b.green), std::fabs(a.blue - b.blue)});
}

double step_length(const OkLab& a, const OkLab& b) {
  return std::sqrt(std::pow(a.lightness - b.lightness, 2) + std::pow(a.a - b.a, 2) +
                   std::pow(a.b - b.b, 2));
}

/// A hill in the middle of a plain, metres up.
Raster hill(int columns, int rows, double cell_m) {
  Raster raster = make_raster(columns, rows, 100.0, 200.0, cell_m);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = (column + 0.5) / columns - 0.5;
      const double y = (row + 0.5) / rows - 0.5;
      raster.at(row, column) = -20.0 + 8.0 * std::exp(-(x * x + y * y) / 0.03);
    }
  }
  return raster;
}

PictureOptions small() {
  PictureOptions options;
  options.width_px = 480;
  return options;
}

TEST(oklab_there_and_back) {
  leadline::test::Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Colour colour = {random.uniform(), random.uniform(), random.uniform()};
    assert_true(difference(render::from_oklab(render::to_oklab(colour)), colour) < 1e-5);
  }
  const OkLab white = render::to_oklab({1.0, 1.0, 1.0});
  assert_near(white.lightness, 1.0, 1e-6);
  assert_near(white.a, 0.0, 1e-6);
  assert_near(white.b, 0.0, 1e-6);
}

TEST(colour_maps_have_equal_steps_and_monotone_lightness) {
  for (const ColourMap* map : {&ColourMap::depth(), &ColourMap::uncertainty()}) {
    double longest = 0.0;
    double shortest = 1.0;
    for (std::size_t i = 1; i < ColourMap::kSteps; ++i) {
      const OkLab before = render::to_oklab(map->table()[i - 1]);
      const OkLab here = render::to_oklab(map->table()[i]);
      assert_true(here.lightness < before.lightness);
      const double step = step_length(before, here);
      longest = std::max(longest, step);
      shortest = std::min(shortest, step);
    }
    assert_true(longest / shortest < 1.2);
  }
}

TEST(diverging_map_is_symmetric_about_its_pale_middle) {
  const ColourMap& map = ColourMap::diverging();
  assert_true(render::to_oklab(map.at(0.5)).lightness > 0.96);
  for (double x = 0.01; x <= 0.5; x += 0.01) {
    const double low = render::to_oklab(map.at(0.5 - x)).lightness;
    const double high = render::to_oklab(map.at(0.5 + x)).lightness;
    assert_near(low, high, 0.03);
    assert_true(low < render::to_oklab(map.at(0.51 - x)).lightness);
  }
  assert_true(map.at(0.0).red > map.at(0.0).blue);
  assert_true(map.at(1.0).blue > map.at(1.0).red);
}

TEST(depth_and_diverging_maps_survive_colour_blindness) {
  // Machado et al. 2009, severity 1, on linear light; rows of protanopia and deuteranopia.
  const double matrices[2][9] = {
      {0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998},
      {0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881}};
  const auto linear = [](double c) {
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  };
  const auto encoded = [](double c) {
    c = std::clamp(c, 0.0, 1.0);
    return c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
  };
  for (const double* m : matrices) {
    const auto seen = [&](const Colour& c) {
      const double r = linear(c.red);
      const double g = linear(c.green);
      const double b = linear(c.blue);
      return render::to_oklab({encoded(m[0] * r + m[1] * g + m[2] * b),
                               encoded(m[3] * r + m[4] * g + m[5] * b),
                               encoded(m[6] * r + m[7] * g + m[8] * b)});
    };
    for (int i = 0; i + 1 < 16; ++i) {
      const OkLab shallow = seen(ColourMap::depth().at(i / 16.0));
      const OkLab deep = seen(ColourMap::depth().at((i + 1) / 16.0));
      assert_true(deep.lightness < shallow.lightness);
      assert_true(step_length(shallow, deep) > 0.02);
    }
    // Too deep and too shallow stay apart.
    assert_true(step_length(seen(ColourMap::diverging().at(0.2)),
                            seen(ColourMap::diverging().at(0.8))) > 0.15);
  }
}

TEST(colour_map_clamps_and_light_keeps_black_and_scales) {
  const ColourMap& map = ColourMap::depth();
  assert_true(difference(map.at(-3.0), map.at(0.0)) == 0.0);
  assert_true(difference(map.at(7.0), map.at(1.0)) == 0.0);
  assert_true(difference(map.at(NAN), map.at(0.0)) == 0.0);
  assert_true(difference(render::lit({0.5, 0.4, 0.3}, 1.0), {0.5, 0.4, 0.3}) < 1e-9);
  assert_true(render::lit({0.5, 0.4, 0.3}, 0.5).red < 0.5);
  assert_near(render::lit({0.9, 0.9, 0.9}, 5.0).red, 1.0, 1e-12);
}

TEST(median_for_display_ignores_gaps_and_fills_none) {
  Raster raster = make_raster(3, 3, 0, 0, 1, 5.0);
  raster.at(1, 1) = 100.0;
  raster.at(0, 0) = kNoValue;
  const Raster filtered = render::display_median(raster, 1);
  assert_near(filtered.at(1, 1), 5.0, 0);
  assert_true(std::isnan(filtered.at(0, 0)));
  raster = make_raster(2, 1, 0, 0, 1, 1.0);
  raster.at(0, 1) = 2.0;
  assert_near(render::display_median(raster, 1).at(0, 0), 1.5, 0);
  assert_near(render::display_median(raster, 0).at(0, 0), 1.0, 0);
}

TEST(dilation_for_display_grows_one_cell_per_pass) {
  Raster raster = make_raster(5, 1, 0, 0, 1);
  raster.at(0, 0) = 4.0;
  raster.at(0, 4) = 8.0;
  const Raster once = render::display_dilation(raster, 1);
  assert_near(once.at(0, 1), 4.0, 0);
  assert_true(std::isnan(once.at(0, 2)));
  assert_near(render::display_dilation(raster, 2).at(0, 2), 6.0, 0);
  assert_int_equal(render::display_dilation(raster, 0).known_count(), 2);
}

TEST(smooth_surface_passes_through_cells_and_respects_gaps) {
  leadline::test::Random random(2);
  Raster raster = make_raster(9, 7, 0, 0, 1);
  for (double& value : raster.values) {
    value = random.normal();
  }
  raster.at(3, 4) = kNoValue;
  const render::SmoothSurface surface(raster);
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double value = surface.at(column + 0.5, row + 0.5);
      if (row == 3 && column == 4) {
        assert_true(std::isnan(value));
        continue;
      }
      assert_near(value, raster.at(row, column), 1e-12);
    }
  }
  assert_true(std::isnan(surface.at(-0.01, 3.0)));
  assert_true(std::isnan(surface.at(9.0, 3.0)));
  assert_true(std::isnan(surface.at(4.01, 3.99)));
  // A plane stays one away from the border.
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      raster.at(row, column) = 3.0 * column - 2.0 * row;
    }
  }
  assert_near(surface.at(4.3, 3.9), 3.0 * 3.8 - 2.0 * 3.4, 1e-12);
}

TEST(light_comes_from_the_north_west) {
  render::Lattice flat;
  flat.columns = 5;
  flat.rows = 5;
  flat.values.assign(25, 1.0F);
  const std::vector<float> level = render::relief_light(flat, 1.0, 1.0, {315.0, 45.0});
  for (const float value : level) {
    assert_near(value, 1.0, 1e-6);
  }
  render::Lattice slope = flat;  // falls towards north-west: it faces the lamp
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      slope.values[slope.index(row, column)] = 0.4F * static_cast<float>(row + column);
    }
  }
  slope.values[0] = NAN;
  const std::vector<float> bright = render::relief_light(slope, 1.0, 1.0, {315.0, 45.0});
  const std::vector<float> dark = render::relief_light(slope, 1.0, 1.0, {135.0, 45.0});
  assert_true(bright[12] > 1.1F);
  assert_true(dark[12] < 0.85F);
  assert_true(std::isnan(bright[0]));
  assert_false(std::isnan(bright[1]));
  // Exaggerated twice is as steep as twice the slope.
  render::Lattice steep = slope;
  for (float& value : steep.values) {
    value *= 2.0F;
  }
  assert_near(render::relief_light(slope, 1.0, 2.0, {315.0, 45.0})[12],
              render::relief_light(steep, 1.0, 1.0, {315.0, 45.0})[12], 1e-6);
}

TEST(hollows_see_less_sky) {
  Raster raster = make_raster(21, 21, 0, 0, 1, 0.0);
  assert_near(render::sky_share(raster, 1.0, 10).at(10, 10), 1.0, 0);
  raster.at(10, 10) = -3.0;
  const Raster share = render::sky_share(raster, 1.0, 10);
  assert_true(share.at(10, 10) < 0.3);
  assert_near(share.at(10, 11), 1.0, 0);
  raster.at(10, 9) = kNoValue;
  assert_true(render::sky_share(raster, 1.0, 10).at(10, 10) > share.at(10, 10));
}

TEST(exaggeration_raises_flat_terrain_only) {
  Raster raster = make_raster(20, 20, 0, 0, 1);
  const auto ramp = [&](double slope) {
    for (int row = 0; row < 20; ++row) {
      for (int column = 0; column < 20; ++column) {
        raster.at(row, column) = slope * column;
      }
    }
    return render::readable_exaggeration(raster);
  };
  assert_near(ramp(1.5), 1.0, 0);
  assert_near(ramp(0.25), 3.0, 0);
  assert_near(ramp(0.02), 30.0, 0);
  assert_near(ramp(1e-6), 100.0, 0);
  assert_near(ramp(0.0), 1.0, 0);
  assert_near(render::readable_exaggeration(make_raster(20, 20, 0, 0, 1)), 1.0, 0);
}

TEST(contours_of_a_cone_are_closed_circles) {
  render::Lattice lattice;
  lattice.columns = 81;
  lattice.rows = 81;
  for (int row = 0; row < 81; ++row) {
    for (int column = 0; column < 81; ++column) {
      lattice.values.push_back(static_cast<float>(std::hypot(column - 40.0, row - 40.0)));
    }
  }
  int closed = 0;
  for (const render::Contour& contour : render::contours(lattice, 10.0, -1e9, 1e9)) {
    if (contour.level == 0.0) {
      continue;  // the tip
    }
    if (contour.level < 40.0) {
      assert_true(contour.closed);
      ++closed;
    }
    for (const render::PointOnLattice& point : contour.points) {
      assert_near(std::hypot(point.column - 40.0, point.row - 40.0), contour.level, 0.02);
    }
  }
  assert_int_equal(closed, 3);
}

TEST(contours_of_a_ramp_cross_once_and_stop_at_gaps) {
  render::Lattice lattice;
  lattice.columns = 11;
  lattice.rows = 6;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 11; ++column) {
      lattice.values.push_back(static_cast<float>(column));
    }
  }
  const std::vector<render::Contour> whole = render::contours(lattice, 2.5, -1e9, 1e9);
  assert_int_equal(whole.size(), 4);  // 2.5, 5, 7.5, 10 (0 has nothing below it)
  for (const render::Contour& contour : whole) {
    assert_false(contour.closed);
    assert_int_equal(contour.points.size(), 6);
    for (const render::PointOnLattice& point : contour.points) {
      assert_near(point.column, contour.level, 1e-6);
    }
  }
  assert_int_equal(render::contours(lattice, 2.5, 5.0, 7.4).size(), 1);
  lattice.values[lattice.index(2, 2)] = NAN;  // interrupts the line at 2.5
  assert_int_equal(render::contours(lattice, 2.5, -1e9, 1e9).size(), 5);
  assert_int_equal(render::contours(lattice, 0.0, -1e9, 1e9).size(), 0);
  lattice.values.assign(lattice.values.size(), 3.0F);
  assert_int_equal(render::contours(lattice, 1.0, -1e9, 1e9).size(), 0);
  lattice.values.assign(lattice.values.size(), NAN);
  assert_int_equal(render::contours(lattice, 1.0, -1e9, 1e9).size(), 0);
}

TEST(contours_separate_high_from_low_on_random_fields) {
  // Every lattice edge whose ends lie on both sides of a level carries exactly one contour point of
  // that level (saddles included).
  leadline::test::Random random(3);
  for (int round = 0; round < 20; ++round) {
    render::Lattice lattice;
    lattice.columns = 12;
    lattice.rows = 9;
    std::size_t crossings = 0;
    for (int i = 0; i < 12 * 9; ++i) {
      lattice.values.push_back(static_cast<float>(random.uniform() - 0.5));
    }
    for (int row = 0; row < 9; ++row) {
      for (int column = 0; column < 12; ++column) {
        const bool here = lattice.at(row, column) >= 0.0F;
        crossings += column + 1 < 12 && here != (lattice.at(row, column + 1) >= 0.0F) ? 1U : 0U;
        crossings += row + 1 < 9 && here != (lattice.at(row + 1, column) >= 0.0F) ? 1U : 0U;
      }
    }
    std::size_t points = 0;
    std::set<std::pair<double, double>> places;
    for (const render::Contour& contour : render::contours(lattice, 1.0, -1e9, 1e9)) {
      points += contour.points.size();
      for (const render::PointOnLattice& point : contour.points) {
        places.insert({point.column, point.row});
      }
    }
    assert_int_equal(points, crossings);
    assert_int_equal(places.size(), crossings);
  }
}

TEST(ticks_are_round_and_inside) {
  const render::Ticks ticks = render::make_ticks(56.2, 83.9, 6);
  assert_near(ticks.step, 5.0, 0);
  assert_int_equal(ticks.decimals, 0);
  assert_near(ticks.values.front(), 60.0, 0);
  assert_near(ticks.values.back(), 80.0, 0);
  const render::Ticks reversed = render::make_ticks(1.0, 0.0, 10);
  assert_int_equal(reversed.values.size(), 11);
  assert_int_equal(reversed.decimals, 1);
  const render::Ticks fine = render::make_ticks(-0.0004, 0.0005, 9);
  assert_near(fine.step, 1e-4, 1e-12);
  assert_int_equal(fine.decimals, 4);
  assert_int_equal(render::make_ticks(3.0, 3.0, 5).values.size(), 1);
  assert_int_equal(render::make_ticks(NAN, 3.0, 5).values.size(), 1);
}

TEST(labels_are_written_for_readers) {
  assert_string_equal(render::tick_label(9999.0, 0).c_str(), "9999");
  assert_string_equal(render::tick_label(12345.0, 0).c_str(), "12\u2009345");
  assert_string_equal(render::tick_label(-7245400.25, 1).c_str(), "\u22127\u2009245\u2009400.2");
  assert_string_equal(render::tick_label(0.0, 2).c_str(), "0.00");
  assert_string_equal(render::length_label(2000.0).c_str(), "2 km");
  assert_string_equal(render::length_label(50.0).c_str(), "50 m");
  assert_string_equal(render::length_label(0.05).c_str(), "5 cm");
  assert_string_equal(render::length_label(0.002).c_str(), "2 mm");
  assert_near(render::round_length_below(499.0), 200.0, 1e-9);
  assert_near(render::round_length_below(500.0), 500.0, 1e-9);
  assert_near(render::round_length_below(0.0), 1.0, 0);
  assert_near(render::round_length_below(INFINITY), 1.0, 0);
}

TEST(depth_picture_shows_shallow_pale_deep_dark_and_gaps_hatched) {
  Raster raster = make_raster(40, 40, 0, 0, 1, -30.0);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < 40; ++column) {
      // West half shallow, east half deep, a gap in the north-west corner.
      raster.at(row, column) = column < 20 ? -10.0 : -30.0;
      if (row < 10 && column < 10) {
        raster.at(row, column) = kNoValue;
      }
    }
  }
  PictureOptions options = small();
  options.shaded_relief = false;
  options.contour_interval_m = 0.0;
  const Picture picture = read_png(render::depth_png(raster, options));
  assert_int_equal(picture.width, 480);
  const render::Layout layout = render::lay_out(480, 40, 40);
  const auto pixel = [&](double column, double row) {
    return picture.at(static_cast<int>(layout.frame.x + layout.frame.width * column / 40.0),
                      static_cast<int>(layout.frame.y + layout.frame.height * row / 40.0));
  };
  assert_true(difference(pixel(5.0, 30.0), ColourMap::depth().at(0.0)) < 0.02);
  assert_true(difference(pixel(35.0, 30.0), ColourMap::depth().at(1.0)) < 0.02);
  const Colour gap = pixel(5.0, 5.0);  // grey
  assert_true(std::fabs(gap.red - gap.blue) < 0.04);
  // Colour bar: shallow on top.
  const int bar_x = static_cast<int>(layout.bar.x + 0.5 * layout.bar.width);
  assert_true(difference(picture.at(bar_x, static_cast<int>(layout.bar.y + 4)),
                         ColourMap::depth().at(0.0)) < 0.06);
  assert_true(difference(picture.at(bar_x, static_cast<int>(layout.bar.bottom() - 4)),
                         ColourMap::depth().at(1.0)) < 0.06);
}

TEST(difference_picture_is_blue_where_deeper) {
  Raster raster = make_raster(10, 10, 0, 0, 1, 0.0);
  for (int row = 0; row < 10; ++row) {
    for (int column = 0; column < 10; ++column) {
      raster.at(row, column) = column < 3 ? 1.0 : column < 7 ? 0.0 : -1.0;
    }
  }
  const Picture picture = read_png(render::difference_png(raster, small()));
  const render::Layout layout = render::lay_out(480, 10, 10);
  const int y = static_cast<int>(layout.frame.y + 0.5 * layout.frame.height);
  const auto pixel = [&](double column) {
    return picture.at(static_cast<int>(layout.frame.x + layout.frame.width * column / 10.0), y);
  };
  assert_true(difference(pixel(1.5), ColourMap::diverging().at(1.0)) < 0.01);
  assert_true(difference(pixel(5.0), ColourMap::diverging().at(0.5)) < 0.01);
  assert_true(difference(pixel(8.5), ColourMap::diverging().at(0.0)) < 0.01);
}

TEST(pictures_repeat_byte_for_byte_and_options_matter) {
  const Raster raster = hill(30, 24, 2.0);
  const std::string plain = render::depth_png(raster, small());
  assert_true(plain == render::depth_png(raster, small()));
  const auto changed = [&](auto change) {
    PictureOptions options = small();
    change(&options);
    return render::depth_png(raster, options) != plain;
  };
  assert_true(changed([](PictureOptions* o) { o->title = "Wreck \u00B7 Tiefe"; }));
  assert_true(changed([](PictureOptions* o) { o->low_m = 5.0; }));
  assert_true(changed([](PictureOptions* o) { o->high_m = 35.0; }));
  assert_true(changed([](PictureOptions* o) { o->contour_interval_m = 3.0; }));
  assert_true(changed([](PictureOptions* o) { o->shaded_relief = false; }));
  assert_true(changed([](PictureOptions* o) { o->sun_azimuth_deg = 90.0; }));
  assert_true(changed([](PictureOptions* o) { o->exaggeration = 7.0; }));
  assert_true(changed([](PictureOptions* o) { o->median_radius_cells = 2; }));
  assert_true(changed([](PictureOptions* o) { o->dilation_passes = 1; }));
  const std::string oblique = render::oblique_png(raster, small());
  assert_true(oblique == render::oblique_png(raster, small()));
  PictureOptions other = small();
  other.view_azimuth_deg = 30.0;
  assert_true(oblique != render::oblique_png(raster, other));
}

TEST(any_raster_can_be_drawn) {
  std::vector<Raster> rasters;
  rasters.push_back(make_raster(1, 1, 0, 0, 1, -5.0));
  rasters.push_back(make_raster(1, 1, 0, 0, 1));
  rasters.push_back(make_raster(64, 64, 0, 0, 1));         // nothing known
  rasters.push_back(make_raster(16, 16, 0, 0, 1, -12.0));  // level
  rasters.push_back(make_raster(16, 16, 0, 0, 1, 0.0));    // at the surface
  rasters.push_back(make_raster(300, 2, -1e6, 1e6, 0.001, -3.0));
  rasters.push_back(make_raster(2, 300, 0, 0, 1000.0, 4000.0));  // land
  rasters.push_back(make_raster(3, 3, 0, 0, 1, -1e5));
  rasters.back().at(1, 1) = 1e5;
  rasters.push_back(make_raster(8, 8, 0, 0, 1));
  rasters.back().at(4, 4) = -1.0;  // a lone cell
  leadline::test::Random random(4);
  rasters.push_back(make_raster(40, 30, 0, 0, 1));
  for (double& value : rasters.back().values) {
    value = random.uniform() < 0.5 ? kNoValue : -1000.0 * random.uniform();
  }
  for (const Raster& raster : rasters) {
    PictureOptions options = small();
    options.width_px = 320;
    for (const double azimuth_deg : {0.0, 90.0, 200.0, -45.0}) {
      options.view_azimuth_deg = azimuth_deg;
      const Picture oblique = read_png(render::oblique_png(raster, options));
      assert_int_equal(oblique.width, 320);
    }
    assert_int_equal(read_png(render::depth_png(raster, options)).width, 320);
    assert_int_equal(read_png(render::uncertainty_png(raster, options)).width, 320);
    const Picture last = read_png(render::difference_png(raster, options));
    assert_int_equal(last.width, 320);
    assert_true(last.height >= 100 && last.height < 1000);
  }
}

TEST(land_is_called_elevation_and_sea_depth) {
  const Raster sea = hill(8, 8, 1.0);
  Raster land = sea;
  for (double& value : land.values) {
    value += 100.0;
  }
  const render::DepthScale depth = render::depth_scale(sea, PictureOptions());
  assert_true(depth.is_depth);
  assert_true(depth.shallow < depth.deep);
  assert_string_equal(depth.title(), "Depth");
  const render::DepthScale elevation = render::depth_scale(land, PictureOptions());
  assert_false(elevation.is_depth);
  assert_true(elevation.shallow > elevation.deep);
  assert_near(elevation.position(elevation.shallow), 0.0, 0);
  assert_near(elevation.position(elevation.deep), 1.0, 0);
}

TEST(options_out_of_range_are_usage_errors) {
  const Raster raster = hill(8, 8, 1.0);
  const auto refused = [&](const char* name, auto change) {
    PictureOptions options = small();
    change(&options);
    assert_contains(error_of(ExitCode::kUsage, [&] { (void)render::depth_png(raster, options); }),
                    name);
  };
  refused("--width", [](PictureOptions* o) { o->width_px = 100000; });
  refused("--width", [](PictureOptions* o) { o->width_px = 0; });
  refused("--sun-azimuth", [](PictureOptions* o) { o->sun_azimuth_deg = NAN; });
  refused("--median", [](PictureOptions* o) { o->median_radius_cells = -1; });
  refused("--dilate", [](PictureOptions* o) { o->dilation_passes = 101; });
  refused("--exaggeration", [](PictureOptions* o) { o->exaggeration = 0.0; });
  refused("--contours", [](PictureOptions* o) { o->contour_interval_m = -1.0; });
  refused("--low", [](PictureOptions* o) { o->low_m = INFINITY; });
  refused("--low", [](PictureOptions* o) {
    o->low_m = 3.0;
    o->high_m = 3.0;
  });
  refused("--view-azimuth", [](PictureOptions* o) { o->view_azimuth_deg = 1e9; });
  refused("--view-elevation", [](PictureOptions* o) { o->view_elevation_deg = 90.0; });
}

/// Voxels 6 north, 8 east, 5 down of 0.5 m: empty above a floor that sinks eastwards, unknown below.
VoxelField voxels() {
  VoxelField field;
  field.size[0] = 6;
  field.size[1] = 8;
  field.size[2] = 5;
  field.cell_m = 0.5;
  field.origin_m[0] = 10.0;
  field.origin_m[1] = 20.0;
  field.origin_m[2] = 30.0;
  field.probability = [](int north, int east, int down) {
    if (north < 0 || north >= 6 || east < 0 || east >= 8 || down < 0 || down >= 5) {
      throw std::out_of_range("voxel");
    }
    const int floor = 1 + east / 3;
    return down < floor ? 0.0 : down == floor ? 1.0 : kNoValue;
  };
  return field;
}

TEST(vertical_slice_has_water_above_and_unknown_below) {
  const Picture picture =
      read_png(render::slice_png(voxels(), VoxelAxis::kNorth, 2, nullptr, small()));
  const render::Layout layout = render::lay_out(480, 8, 5);
  const auto pixel = [&](int east, int down) {
    return picture.at(static_cast<int>(layout.frame.x + layout.frame.width * (east + 0.5) / 8.0),
                      static_cast<int>(layout.frame.y + layout.frame.height * (down + 0.5) / 5.0));
  };
  assert_true(difference(pixel(0, 0), ColourMap::diverging().at(1.0)) < 0.01);  // empty: blue
  assert_true(difference(pixel(0, 1), ColourMap::diverging().at(0.0)) < 0.01);  // there: brown
  const Colour unknown = pixel(0, 3);
  assert_true(std::fabs(unknown.red - unknown.blue) < 0.04);
  assert_true(difference(pixel(7, 2), ColourMap::diverging().at(1.0)) < 0.01);
  assert_true(difference(pixel(7, 3), ColourMap::diverging().at(0.0)) < 0.01);
}

TEST(level_slice_is_a_map_with_north_up) {
  VoxelField field = voxels();
  field.probability = [](int north, int east, int) {
    return north == 5 && east == 0 ? 1.0 : 0.0;  // the north-west corner
  };
  const Picture picture = read_png(render::slice_png(field, VoxelAxis::kDown, 0, nullptr, small()));
  const render::Layout layout = render::lay_out(480, 8, 6);
  const Colour corner = picture.at(static_cast<int>(layout.frame.x + layout.frame.width / 16.0),
                                   static_cast<int>(layout.frame.y + layout.frame.height / 12.0));
  assert_true(difference(corner, ColourMap::diverging().at(0.0)) < 0.01);
}

TEST(slices_along_every_axis_and_their_errors) {
  const VoxelField field = voxels();
  Raster surface = make_raster(8, 6, 20.0, 10.0, 0.5, -31.0);
  surface.at(2, 3) = kNoValue;
  for (const VoxelAxis axis : {VoxelAxis::kNorth, VoxelAxis::kEast, VoxelAxis::kDown}) {
    const int count = field.size[static_cast<int>(axis)];
    for (int index = 0; index < count; ++index) {
      assert_int_equal(read_png(render::slice_png(field, axis, index, &surface, small())).width,
                       480);
    }
    for (const int outside : {-1, count}) {
      assert_contains(
          error_of(ExitCode::kUsage,
                   [&] { (void)render::slice_png(field, axis, outside, nullptr, small()); }),
          "outside 0 .. ");
    }
  }
  assert_true(render::slice_png(field, VoxelAxis::kNorth, 1, &surface, small()) !=
              render::slice_png(field, VoxelAxis::kNorth, 1, nullptr, small()));
  (void)error_of(ExitCode::kUsage, [] {
    (void)render::slice_png(VoxelField(), VoxelAxis::kNorth, 0, nullptr, PictureOptions());
  });
  (void)error_of(ExitCode::kUsage,
                 [] { (void)render::histogram_png(VoxelField(), PictureOptions()); });
}

TEST(histogram_of_anything) {
  VoxelField field = voxels();
  assert_int_equal(read_png(render::histogram_png(field, small())).width, 480);
  field.probability = [](int, int, int) { return kNoValue; };
  assert_int_equal(read_png(render::histogram_png(field, small())).width, 480);
  field.probability = [](int, int, int) { return 0.5; };
  assert_int_equal(read_png(render::histogram_png(field, small())).width, 480);
}

/// A result folder as `leadline map` leaves it, without the model.
std::string result_folder() {
  const std::string folder = leadline::test::scratch_directory();
  leadline::host::write_esri_ascii(hill(8, 6, 0.5), folder + "/depth.asc");
  leadline::host::write_esri_ascii(make_raster(8, 6, 100, 200, 0.5, 0.25), folder + "/sigma.asc");
  leadline::host::write_esri_ascii(make_raster(8, 6, 100, 200, 0.5, -20.0), folder + "/truth.asc");
  return folder;
}

TEST(the_command_draws_one_view) {
  const std::string folder = result_folder();
  render::RenderOptions options;
  options.input_path = folder;
  options.reference_path = folder + "/truth.asc";
  options.voxels = voxels();
  options.picture = small();
  using render::View;
  for (const View view : {View::kDepth, View::kOblique, View::kUncertainty, View::kDifference,
                          View::kSlice, View::kHistogram}) {
    options.view = view;
    options.out_path = folder + "/" + render::view_name(view) + ".png";
    assert_int_equal(render::run_render(options), 0);
    assert_true(fs::file_size(options.out_path) > 1000);
  }
  // A raster instead of a folder.
  options.view = render::View::kDepth;
  options.input_path = folder + "/depth.asc";
  options.out_path = folder + "/again.png";
  assert_int_equal(render::run_render(options), 0);
  options.slice_at_m = 12.9;
  options.view = render::View::kSlice;
  assert_int_equal(render::run_render(options), 0);
}

TEST(the_command_draws_all_that_the_input_allows) {
  const std::string folder = result_folder();
  render::RenderOptions options;
  options.input_path = folder;
  options.out_path = folder + "/pictures";
  options.picture = small();
  assert_int_equal(render::run_render(options), 0);
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(options.out_path)) {
    names.insert(entry.path().filename().string());
  }
  assert_true((names == std::set<std::string>{"depth.png", "oblique.png", "uncertainty.png"}));
  options.voxels = voxels();
  options.reference_path = folder + "/truth.asc";
  assert_int_equal(render::run_render(options), 0);
  for (const char* name : {"difference", "slice_north", "slice_east", "slice_down", "histogram"}) {
    assert_true(fs::exists(options.out_path + "/" + name + ".png"));
  }
}

TEST(what_the_command_refuses) {
  const std::string folder = result_folder();
  render::RenderOptions options;
  options.input_path = folder;
  options.out_path = folder + "/a.png";
  options.picture = small();
  options.view = render::View::kDifference;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)render::run_render(options); }),
                  "--reference");
  options.view = render::View::kSlice;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)render::run_render(options); }), "slice");
  options.voxels = voxels();
  options.slice_at_m = 99.0;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)render::run_render(options); }),
                  "--at 99");
  options.view = render::View::kDepth;
  options.input_path = folder + "/none.asc";
  assert_contains(error_of(ExitCode::kInput, [&] { (void)render::run_render(options); }),
                  "none.asc");
  options.input_path = folder;
  options.out_path = folder + "/no/such/a.png";
  (void)error_of(ExitCode::kOutput, [&] { (void)render::run_render(options); });
  assert_false(fs::exists(folder + "/a.png"));
}

}  // namespace
