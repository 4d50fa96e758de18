// Rasters of the host: a grid of metres (elevation, sigma, mask) and its ESRI ASCII form.
//
// Frame. Columns run west to east, rows north to south: values[0] is the north-west cell, as in the
// file. A cell covers [edge, edge + cell_m) eastwards and northwards; its value belongs to its centre.
// Sign. Elevations are up: depth (positive down) is minus the value. This module only stores numbers;
// who needs depth negates.
// Nodata is a quiet NaN in memory and nodata_value() in the file.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace leadline::host {

/// Nodata value of every file that this program writes.
inline constexpr double kRasterNodata = -9999.0;

/// What a cell without a value holds in memory (test with std::isnan).
inline constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

/// Most cells that a reader accepts (a quarter of a gibi): a header that promises more is an error,
/// not an allocation.
inline constexpr std::size_t kMaxRasterCells = std::size_t{1} << 28U;

struct Raster {
  int columns = 0;             ///< cells west to east
  int rows = 0;                ///< cells north to south
  double west_m = 0.0;         ///< easting of the west edge of column 0 (xllcorner)
  double south_m = 0.0;        ///< northing of the south edge of the last row (yllcorner)
  double cell_m = 1.0;         ///< edge of a cell, > 0
  std::vector<double> values;  ///< columns * rows, row-major from the north-west; NaN = no value

  /// Index into values; row and column must be inside.
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] double at(int row, int column) const { return values[index(row, column)]; }
  [[nodiscard]] double& at(int row, int column) { return values[index(row, column)]; }
  [[nodiscard]] bool contains(int row, int column) const {
    return row >= 0 && row < rows && column >= 0 && column < columns;
  }
  /// Coordinates of cell centres.
  [[nodiscard]] double east_of_column_m(int column) const {
    return west_m + (column + 0.5) * cell_m;
  }
  [[nodiscard]] double north_of_row_m(int row) const {
    return south_m + (rows - row - 0.5) * cell_m;
  }
  [[nodiscard]] double north_m() const { return south_m + rows * cell_m; }   ///< north edge
  [[nodiscard]] double east_m() const { return west_m + columns * cell_m; }  ///< east edge
  /// Cells that have a value.
  [[nodiscard]] std::size_t known_count() const;
};

/// A raster of the given geometry, every cell `fill`.
[[nodiscard]] Raster make_raster(int columns, int rows, double west_m, double south_m,
                                 double cell_m, double fill = kNoValue);

/// Every value with the other sign: elevation and depth turn into each other.
[[nodiscard]] Raster negated(const Raster& raster);

/// True when both cover the same cells: equal counts, edges and cell within a thousandth of a cell.
[[nodiscard]] bool same_geometry(const Raster& a, const Raster& b);

/// "128 x 128 cells of 1 m from east 0, north 0": for messages that compare two rasters.
[[nodiscard]] std::string describe_geometry(const Raster& raster);

/// Reads an ESRI ASCII grid from text. `name` is the file's name in messages.
///
/// Header: ncols, nrows, xllcorner or xllcenter, yllcorner or yllcenter, cellsize, each once, in any
/// order and case, then optionally NODATA_value (default -9999; "nan" is understood). Values follow
/// in reading order; line breaks between them carry no meaning (as in GDAL). A value is one decimal
/// number, with or without exponent, independent of the locale.
/// Errors (HostError kInput) name file, line, field and value: unknown, repeated or missing
/// header key; counts not in 1..; cellsize not positive; a value that is not a finite number (nan only
/// where NODATA_value is nan); too few or too many values; more than kMaxRasterCells cells.
/// Time and memory O(text), whatever the header promises.
[[nodiscard]] Raster parse_esri_ascii(std::string_view text, const std::string& name);

/// Reads the file. Errors as above; unreadable file: HostError kInput.
[[nodiscard]] Raster read_esri_ascii(const std::string& path);

/// The file's text: header as in the contract of `leadline map` (ncols, nrows, xllcorner, yllcorner,
/// cellsize, NODATA_value -9999), then one line per row, north first, `decimals` digits after the
/// point (0..9). A value that would round to the nodata value itself is moved up by one last digit.
[[nodiscard]] std::string format_esri_ascii(const Raster& raster, int decimals = 4);

/// Digits after the point that keep a tenth of a depth's own step (1/256 cell) in metres.
[[nodiscard]] int raster_decimals(double cell_m);

/// Writes the file whole or not at all (write_file_whole). Errors: HostError kOutput.
void write_esri_ascii(const Raster& raster, const std::string& path, int decimals = 4);

}  // namespace leadline::host
