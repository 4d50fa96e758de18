#!/usr/bin/env python3
"""`leadline map`: its results, and places that cannot be written."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import CONFIG, HEADER, LEADLINE, OK, OUTPUT, RESULTS, Case, rows  # noqa: E402


STATS_KEYS = [
    "pings", "rejected", "voxel_updates", "max_voxels_per_ping", "work_bound", "integrate_seconds",
    "extract_seconds", "bytes_per_voxel", "entropy_bits", "known_fraction", "table_crc", "map_hash",
]


class MapWorks(Case):
    def test_results_and_statistics(self):
        done = self.expect(self.run_map("--json"), OK)
        self.assertEqual(sorted(os.listdir(self.out)), RESULTS)
        stats = json.loads((self.out / "stats.json").read_text())
        self.assertEqual(list(stats), STATS_KEYS)
        self.assertEqual(json.loads(done.stdout), stats)
        self.assertEqual(stats["pings"], 400)
        self.assertEqual(stats["rejected"], {})
        self.assertGreater(stats["voxel_updates"], 0)
        self.assertLessEqual(stats["max_voxels_per_ping"], stats["work_bound"])
        self.assertEqual(done.stderr, "")

    def test_rasters_are_esri_ascii_elevations(self):
        self.expect(self.run_map(), OK)
        lines = (self.out / "depth.asc").read_text().splitlines()
        head = dict(line.split() for line in lines[:6])
        self.assertEqual({k.lower(): float(v) for k, v in head.items()},
                         {"ncols": 16, "nrows": 16, "xllcorner": 0, "yllcorner": 0, "cellsize": 1,
                          "nodata_value": -9999})
        values = [float(v) for line in lines[6:] for v in line.split()]
        self.assertEqual(len(values), 256)
        known = [v for v in values if v != -9999]
        self.assertGreater(len(known), 200)
        for value in known:
            self.assertAlmostEqual(value, -14.0, delta=0.5)

    def test_the_origin_becomes_the_corner(self):
        self.config.write_text(CONFIG.replace("[0, 0, 10000]", "[-3500, 7250, 10000]"))
        self.write_rows([f"{i},{i % 12 - 3},{i % 14 + 8},2,0,0,0,0,90,12" for i in range(200)])
        self.expect(self.run_map(), OK)
        head = (self.out / "sigma.asc").read_text().lower()
        self.assertRegex(head, r"xllcorner\s+7\.25\b")
        self.assertRegex(head, r"yllcorner\s+-3\.5\b")

    def test_same_input_same_map(self):
        hashes = set()
        for name in ("a", "b"):
            self.out = self.dir / name
            hashes.add(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"])
        self.assertEqual(len(hashes), 1)
        for name in ("depth.asc", "sigma.asc", "model.llm", "depth.png"):
            self.assertEqual((self.dir / "a" / name).read_bytes(), (self.dir / "b" / name).read_bytes())

    def test_columns_in_any_order_and_extra_ones(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        names = HEADER.split(",")
        lines = [",".join(reversed(row.split(","))) + ",hello" for row in rows()]
        self.write_rows(lines, ",".join(reversed(names)) + ",note")
        done = self.expect(self.run_map("--json"), OK, "ignored an extra column: \"note\"")
        self.assertEqual(json.loads(done.stdout)["map_hash"], first)

    def test_standard_input(self):
        text = self.pings.read_text()
        done = self.expect(self.run_leadline("map", "--pings", "-", "--config", self.config, "--out",
                                             self.out, "--json", stdin=text), OK)
        self.assertEqual(json.loads(done.stdout)["pings"], 400)

    def test_angles_are_wrapped(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        self.write_rows([row.replace(",0,0,0,0,90,", ",360,-720,3600000000,1080,450,") for row in rows()])
        self.assertEqual(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"], first)

    def test_crlf_comments_blank_lines_and_byte_order_mark(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        text = self.pings.read_text().replace("\n", "\r\n# x\r\n\r\n")
        self.pings.write_bytes(b"\xef\xbb\xbf" + text.encode())
        self.assertEqual(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"], first)


class BadOutput(Case):
    def test_place_that_is_a_file(self):
        self.out.write_text("mine")
        self.expect(self.run_map(), OUTPUT, str(self.out))
        self.assertEqual(self.out.read_text(), "mine")

    def test_place_that_cannot_be_made(self):
        self.out = pathlib.Path("/proc/leadline")
        self.expect(self.run_map(), OUTPUT, "/proc/leadline")

    def test_disk_that_fills_up(self):
        # A file size limit stands in for it. Earlier results stay, nothing half-written is left.
        self.expect(self.run_map(), OK)
        before = {name: (self.out / name).read_bytes() for name in RESULTS}
        self.write_rows(rows(300))
        self.expect(self.run_map(limit_bytes=1500), OUTPUT, "File too large")
        after = {name: (self.out / name).read_bytes() for name in os.listdir(self.out)}
        self.assertEqual(after, before)

    def test_result_name_that_is_a_folder(self):
        (self.out / "depth.asc").mkdir(parents=True)
        self.expect(self.run_map(), OUTPUT, "depth.asc", "directory")
        self.assertEqual(os.listdir(self.out), ["depth.asc"])

    def test_killed_in_the_middle(self):
        # Pings come through a pipe that stays open: the run is in the middle of its work for sure.
        self.expect(self.run_map(), OK)
        before = {name: (self.out / name).read_bytes() for name in RESULTS}
        run = subprocess.Popen([LEADLINE, "map", "--pings", "-", "--config", str(self.config), "--out",
                                str(self.out)], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)
        run.stdin.write("\n".join([HEADER] + rows(20000)).encode())
        run.stdin.flush()
        run.send_signal(signal.SIGKILL)
        run.wait()
        run.stdin.close()
        for name in RESULTS:
            self.assertEqual((self.out / name).read_bytes(), before[name])
        self.expect(self.run_map(), OK)
        self.assertEqual(sorted(os.listdir(self.out)), RESULTS)

    def test_standard_output_that_is_full(self):
        with open("/dev/full", "w") as full:
            self.expect(self.run_map("--json", stdout=full), OUTPUT, "standard output")

if __name__ == "__main__":
    unittest.main()
