#!/usr/bin/env python3
"""Bad configurations: exit code 2, file, line, key and value named, nothing created."""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import CONFIG, OK, USAGE, Case  # noqa: E402


class BadConfiguration(Case):
    def expect_refused(self, text, *parts):
        self.config.write_text(text)
        self.expect(self.run_map(), USAGE, *parts)
        self.assertFalse(self.out.exists())

    def test_unknown_key_with_a_suggestion(self):
        self.expect_refused(CONFIG.replace("sigma_range_mm", "sigma_rnage_mm"),
                            "map.toml:8: [sonar] sigma_rnage_mm: unknown key", '"sigma_range_mm"')

    def test_zero_cells(self):
        self.expect_refused(CONFIG.replace("[16, 16, 8]", "[16, 0, 8]"), "map.toml:3: [grid] size[1] = 0")

    def test_zero_cell_size(self):
        self.expect_refused(CONFIG.replace("cell_mm = 1000", "cell_mm = 0"), "map.toml:2: [grid] cell_mm = 0")

    def test_grid_over_capacity(self):
        self.expect_refused(CONFIG.replace("[16, 16, 8]", "[4000, 4000, 1000]"), "capacity", "16000000000")

    def test_not_a_number(self):
        self.expect_refused(CONFIG.replace("sigma_range_mm = 200", "sigma_range_mm = nan"),
                            "map.toml:8: [sonar] sigma_range_mm = nan")

    def test_no_beam(self):
        self.expect_refused(CONFIG.replace("beam_half_angle_deg = 3\n", ""), "needs one beam description")

    def test_two_beams(self):
        self.expect_refused(CONFIG + "piston_diameter_mm = 80\nfrequency_hz = 1e5\n", "more than one beam")

    def test_unknown_rule(self):
        self.expect_refused(CONFIG + '[model]\nrule = "magic"\n', "weighted_mean", "log_odds")

    def test_other_schema_version(self):
        self.expect_refused("schema_version = 9\n" + CONFIG, "map.toml:1: schema_version = 9")

    def test_not_toml(self):
        self.expect_refused(CONFIG + "= 3\n", "map.toml:11: not valid TOML")

    def test_empty(self):
        self.expect_refused("", "[grid]")

    def test_file_that_is_not_there(self):
        self.config.unlink()
        self.expect(self.run_map(), USAGE, "map.toml", "No such file")

    def test_pattern_file_that_is_not_there(self):
        self.expect_refused(CONFIG.replace("beam_half_angle_deg = 3", 'pattern_file = "none.csv"'),
                            str(self.dir / "none.csv"))

    def test_pattern_file_that_is_malformed(self):
        (self.dir / "beam.txt").write_text("0 0\n5 loud\n")
        self.expect_refused(CONFIG.replace("beam_half_angle_deg = 3", 'pattern_file = "beam.txt"'),
                            "beam.txt:2", "loud")

    def test_range_over_what_the_model_can_hold(self):
        self.expect_refused(CONFIG.replace("max_range_mm = 60000", "max_range_mm = 8000001"),
                            "max_range_mm = 8000001", "8000 cells")

    def test_work_over_the_budget(self):
        self.expect(self.run_map("--work-budget", 10), USAGE, "map.toml", "one ping can touch up to",
                    "the budget is 10")
        self.assertFalse(self.out.exists())
        self.expect(self.run_map("--work-budget", 1000000), OK)

if __name__ == "__main__":
    unittest.main()
