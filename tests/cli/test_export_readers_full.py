#!/usr/bin/env python3
"""What PCL makes of our PLY files, and independent readers of the LAS: the same points, all of them.

PCL reads no LAS, and Debian 12 packages no reader of it. Two do: `copc` of the npm registry, by the authors of PDAL,
with extra bytes; and here the LAS is taken apart by the offsets of the standard's tables (ASPRS LAS 1.2, 2008), with
nothing of the writer's.
"""

import os
import pathlib
import shutil
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import OK, Case  # noqa: E402

PLY_TO_PCD = "pcl_ply2pcd"
SKIPPED = 77
LAS_MODULES = pathlib.Path(os.environ["LEADLINE_ROOT"]) / "build" / "las_reader"
LAS_POINTS = pathlib.Path(__file__).resolve().parent / "support" / "las_reader" / "las_points.mjs"
GROUND = 2


def read_pcd(path):
    """x, y, z of every point of a PCD file in ASCII."""
    fields, points, in_data = [], [], False
    for line in path.read_text().splitlines():
        words = line.split()
        if in_data:
            row = dict(zip(fields, words))
            points.append(tuple(float(row[axis]) for axis in "xyz"))
        elif words[0] == "FIELDS":
            fields = words[1:]
        elif words[0] == "DATA":
            assert words[1] == "ascii", line
            in_data = True
    return points


def read_las(path):
    data = path.read_bytes()
    assert data[:4] == b"LASF" and data[24:26] == b"\1\2"
    first, = struct.unpack_from("<I", data, 96)
    size, count = struct.unpack_from("<HI", data, 105)
    scale = struct.unpack_from("<3d", data, 131)
    offset = struct.unpack_from("<3d", data, 155)
    assert len(data) == first + size * count
    return [tuple(offset[a] + scale[a] * raw for a, raw in
                  enumerate(struct.unpack_from("<3i", data, first + k * size))) for k in range(count)]


class Readers(Case):
    def setUp(self):
        super().setUp()
        self.expect(self.run_leadline("map", "--pings", self.pings, "--config", self.config, "--out",
                                      self.out), OK)

    def exported(self, name, *options):
        self.expect(self.run_leadline("export", self.out, "--out", self.dir / name, *options), OK)
        return self.dir / name

    def cells(self):
        """The map's known cells as XYZ has them: north-west first, as PLY and LAS."""
        text = self.exported("cells.xyz", "--format", "xyz168", "--frame", "local").read_text()
        return [tuple(map(float, line.split()[:3])) for line in text.splitlines() if line[0] != "#"]

    def same(self, points, others, tolerance):
        self.assertGreater(len(others), 0)
        self.assertEqual(len(points), len(others))
        for point, other in zip(points, others):
            for a, b in zip(point, other):
                self.assertAlmostEqual(a, b, delta=tolerance)

    def pcl_points(self, ply):
        pcd = ply.with_suffix(".pcd")
        done = subprocess.run([PLY_TO_PCD, "-format", "0", str(ply), str(pcd)], capture_output=True,
                              text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return read_pcd(pcd)

    def test_pcl_reads_the_seafloor(self):
        # PCL holds floats: six digits.
        self.same(self.pcl_points(self.exported("cells.ply")), self.cells(), 1e-3)

    def test_pcl_reads_the_voxels_that_las_has(self):
        voxels = read_las(self.exported("voxels.las", "--layer", "voxels"))
        self.same(self.pcl_points(self.exported("voxels.ply", "--layer", "voxels")), voxels, 1e-3)

    def test_las_has_the_cells(self):
        self.same(read_las(self.exported("cells.las")), self.cells(), 1e-4)

    @unittest.skipUnless((LAS_MODULES / "node_modules" / "copc").is_dir(), "no copc (toolchain/setup.sh --full)")
    def test_another_reader_has_the_cells_with_their_sigmas(self):
        las = self.exported("cells.las")
        done = subprocess.run(["node", str(LAS_POINTS), str(las), str(LAS_MODULES)], capture_output=True, text=True,
                              timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = [tuple(map(float, line.split())) for line in done.stdout.splitlines()]
        self.same([row[:3] for row in rows], self.cells(), 1e-4)
        self.assertEqual({row[3] for row in rows}, {GROUND})
        text = (self.out / "sigma.asc").read_text().splitlines()
        nodata = next(line.split()[1] for line in text if line.lower().startswith("nodata"))
        sigmas = [float(word) for line in text if not line[0].isalpha() for word in line.split() if word != nodata]
        self.assertEqual(len(rows), len(sigmas))
        for row, sigma in zip(rows, sigmas):
            self.assertAlmostEqual(row[4], sigma, delta=1e-3 * sigma)


if __name__ == "__main__":
    if shutil.which(PLY_TO_PCD) is None:
        print(f"skipped: no {PLY_TO_PCD} (Debian: pcl-tools; toolchain/setup.sh --full)")
        sys.exit(SKIPPED)
    unittest.main()
