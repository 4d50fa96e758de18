#!/usr/bin/env python3
"""Bad pings: every kind is counted and described, stops with --strict, and changes no voxel."""

import json
import pathlib
import shutil
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import HEADER, INPUT, OK, Case, rows  # noqa: E402


class BadPings(Case):
    clean = None  # statistics of the rows without a bad one among them

    def expect_counted(self, bad_row, reason, *parts):
        """The row is counted and described, and the map is the one without it; --strict stops."""
        good = rows()
        if BadPings.clean is None:
            BadPings.clean = json.loads(self.expect(self.run_map("--json"), OK).stdout)
            shutil.rmtree(self.out)
        clean = BadPings.clean
        self.write_rows(good[:200] + [bad_row] + good[200:])
        done = self.expect(self.run_map("--json"), OK, *parts)
        stats = json.loads(done.stdout)
        self.assertEqual(stats["rejected"], {reason: 1})
        self.assertEqual(stats["pings"], 400)
        self.assertEqual(stats["map_hash"], clean["map_hash"])
        self.assertEqual(stats["voxel_updates"], clean["voxel_updates"])
        shutil.rmtree(self.out)
        if reason in ("range_below_min", "range_above_max"):
            self.expect(self.run_map("--strict"), OK)
            return
        self.expect(self.run_map("--strict"), INPUT, "pings.csv:202", *parts)
        self.assert_no_results()

    def test_malformed(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,12..5", "malformed",
                            'pings.csv:202: column range_m: value "12..5": ')

    def test_missing(self):
        self.expect_counted("199500,1,,2,0,0,0,0,90,12", "missing", 'pings.csv:202: column y_m: value ""')

    def test_cut_row(self):
        self.expect_counted("199500,1,2,2,0,0", "missing", "pings.csv:202: column heading_deg")

    def test_nan(self):
        self.expect_counted("199500,1,2,nan,0,0,0,0,90,12", "not_finite", 'column z_m: value "nan"')

    def test_infinite(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,-inf", "not_finite", 'column range_m: value "-inf"')

    def test_absurd(self):
        self.expect_counted("199500,1,2,1e9,0,0,0,0,90,12", "out_of_range", 'column z_m: value "1e9"')

    def test_negative_range(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,-12", "out_of_range", 'value "-12"')

    def test_time_backwards(self):
        self.expect_counted("198999,1,2,2,0,0,0,0,90,12", "time_backwards", 'column time_us: value "198999"')

    def test_range_below_minimum(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,0.4999", "range_below_min")

    def test_range_above_maximum(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,60.0001", "range_above_max")

    def test_bytes_that_are_no_text(self):
        self.pings.write_bytes((HEADER + "\n").encode() + b"\x00\xff\x1b[2J,1\n" + "\n".join(rows()).encode() + b"\n")
        done = self.expect(self.run_map(), OK, "pings.csv:2: ")
        self.assertNotIn("\x1b", done.stderr)
        self.assertNotIn("\x00", done.stderr)

    def test_re_origin(self):
        self.write_rows(rows() + ["999999,4500000.5,500000,2,0,0,0,0,90,12"])
        self.expect(self.run_map(), INPUT, "pings.csv:402: column x_m", "re-origin")
        self.assert_no_results()

    def test_empty_file(self):
        self.pings.write_bytes(b"")
        self.expect(self.run_map(), INPUT, "pings.csv", "is empty")
        self.assert_no_results()

    def test_header_only(self):
        self.write_rows([])
        self.expect(self.run_map(), INPUT, "no row after the header")

    def test_no_usable_row(self):
        self.write_rows(["x,1,2,2,0,0,0,0,90,12", "1,nan,2,2,0,0,0,0,90,12"])
        self.expect(self.run_map(), INPUT, "no usable row among 2", "pings.csv:2: column time_us")
        self.assert_no_results()

    def test_no_row_within_the_range_limits(self):
        self.write_rows(["0,1,2,2,0,0,0,0,90,0.1", "1,1,2,2,0,0,0,0,90,99"])
        self.expect(self.run_map(), INPUT, "range_below_min 1", "range_above_max 1", "min_range_mm = 500")
        self.assert_no_results()

    def test_missing_column(self):
        self.write_rows(rows(), HEADER.replace("heading_deg", "heading"))
        self.expect(self.run_map(), INPUT, "column heading_deg is missing", '"heading"')

    def test_file_that_is_not_there(self):
        self.pings.unlink()
        self.expect(self.run_map(), INPUT, "pings.csv", "No such file")

    def test_folder_instead_of_a_file(self):
        self.pings.unlink()
        self.pings.mkdir()
        self.expect(self.run_map(), INPUT, "is a directory")

if __name__ == "__main__":
    unittest.main()
