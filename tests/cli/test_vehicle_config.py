"""What `leadline-vehicle` says before it flies: resolved configuration, memory, work bound, and errors that
name what is wrong."""

import json
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import INPUT, OK, OUTPUT, USAGE, Case  # noqa: E402


class Check(Case):
    def check(self, *arguments):
        return self.run_vehicle("--config", self.config, "--check-config", *arguments)

    def test_the_report_reads_back_and_tells_memory_and_work(self):
        done = self.expect(self.check(), OK)
        for part in ["[grid]\ncell_mm = 500", "driver = \"ping1d\"", "interval_ms = 40",
                     "sound_speed_mm_s = 1500000", "vehicle_static", "voxels_used", "ping_voxels"]:
            self.assertIn(part, done.stdout)
        again = self.dir / "resolved.toml"
        again.write_text(done.stdout)
        self.config = again
        self.assertEqual(self.expect(self.check(), OK).stdout, done.stdout)
        self.assertFalse(self.log.exists())

    def test_json_holds_the_same(self):
        report = json.loads(self.expect(self.check("--json"), OK).stdout)
        self.assertEqual(report["config"]["port"][0]["driver"], "ping1d")
        self.assertEqual(report["config"]["grid"]["size"], [64, 64, 48])
        memory, work = report["memory"], report["work"]
        self.assertEqual(memory["voxels_used"], 64 * 64 * 48)
        self.assertEqual(memory["model_static"] + memory["pipeline_static"], memory["vehicle_static"])
        self.assertLess(memory["model_used"], memory["model_static"])
        self.assertEqual(work["ping_voxels"], work["ping_shell_voxels"] + work["ping_cone_voxels"])
        self.assertGreater(work["ping_voxels"], 0)
        # Without a budget: 8 of the worst pings; 0 is as many as the queue of 256 holds.
        self.assertEqual(work["cycle_voxels"], 8 * work["ping_voxels"])
        self.assertEqual(report["config"]["cycle"]["voxel_budget"], work["cycle_voxels"])
        self.write_config("[cycle]\nvoxel_budget = 0\n")
        unlimited = json.loads(self.expect(self.check("--json"), OK).stdout)
        self.assertEqual(unlimited["work"]["cycle_voxels"], 4096 * work["ping_voxels"])
        self.assertEqual(unlimited["config"]["cycle"]["voxel_budget"], 0)
        self.write_config("[cycle]\nvoxel_budget = 100000\n")
        report = json.loads(self.expect(self.check("--json"), OK).stdout)
        self.assertEqual(report["work"]["cycle_voxels"], 100000)

    def test_the_command_line_overrides(self):
        report = json.loads(self.expect(self.check(
            "--json", "--port", "1=udp:127.0.0.1:4000", "--port", "0=file:a=b", "--link", "tcp:h:1",
            "--log", "other.lll"), OK).stdout)["config"]
        self.assertEqual(report["port"][1]["uri"], "udp:127.0.0.1:4000")
        self.assertEqual(report["port"][0]["uri"], "file:a=b")
        self.assertEqual(report["link"]["uri"], "tcp:h:1")
        self.assertEqual(report["log"]["path"], "other.lll")
        report = json.loads(self.expect(self.check("--json", "--log", ""), OK).stdout)["config"]
        self.assertNotIn("log", report)

    def test_the_example_is_printed_and_good(self):
        done = self.expect(self.run_vehicle("--help-config"), OK)
        self.config.write_text(done.stdout)
        (self.dir / "ping1d.llt").write_bytes((self.dir / "beam.llt").read_bytes())
        self.expect(self.check(), OK)

    def test_help_and_version(self):
        self.assertIn("--check-config", self.expect(self.run_vehicle("--help"), OK).stdout)
        self.assertIn("leadline-vehicle ", self.expect(self.run_vehicle("--version"), OK).stdout)

    def test_usage_errors_name_what_is_wrong(self):
        self.expect(self.run_vehicle(), USAGE, "--config is required", "--help-config")
        self.expect(self.run_vehicle("--nonsense"), USAGE, "--nonsense")
        self.expect(self.run_vehicle("--config", self.dir / "no.toml"), USAGE, "no.toml", "cannot be read: No such file")
        self.expect(self.check("--port", "2=udp:h:1"), USAGE, "--port 2=udp:h:1: has to be N=URI",
                    "N from 0 to 1")
        self.expect(self.check("--port", "udp:h:1"), USAGE, "has to be N=URI")
        self.expect(self.check("--port", "0=com1"), USAGE, "--port 0: ", "has to begin with serial:")
        self.expect(self.check("--link", "udp:h"), USAGE, "--link: ", "needs a port")
        self.expect(self.check("--clock", "sundial"), USAGE, "--clock sundial: has to be lockstep:PATH")
        self.expect(self.check("--clock", "lockstep:"), USAGE, "has to be lockstep:PATH")
        self.expect(self.check("--drain-s", "-1"), USAGE, "--drain-s")

    def test_configuration_errors_come_all_at_once(self):
        self.write_config("[cycle]\nperiod_ms = 0\nvoxel_budgte = 3\n")
        done = self.expect(self.check(), USAGE, "vehicle.toml:", "[cycle] period_ms = 0: has to be",
                           "voxel_budgte: unknown key; did you mean \"voxel_budget\"?")
        self.assertEqual(len(done.stderr.strip().splitlines()), 2)

    def test_work_over_the_budget(self):
        self.write_config("[cycle]\nping_voxel_budget = 10\n")
        self.expect(self.check(), USAGE, "vehicle.toml", "one ping can touch up to", "budget is 10")

    def test_tables_that_are_missing_or_damaged(self):
        table = self.dir / "beam.llt"
        good = table.read_bytes()
        table.write_bytes(good[:100] + bytes([good[100] ^ 1]) + good[101:])
        self.expect(self.check(), INPUT, "beam.llt: damaged")
        table.write_bytes(good[:1000])
        self.expect(self.check(), INPUT, "beam.llt: truncated: 1000 of 25832 bytes")
        table.unlink()
        self.expect(self.check(), INPUT, "beam.llt: cannot be read: No such file")

    def test_a_log_that_cannot_be_made(self):
        self.expect(self.run_vehicle("--config", self.config, "--log", "/nowhere/s.lll"), OUTPUT,
                    "/nowhere/s.lll: cannot create the log: No such file")

    def test_hosts_and_addresses_that_cannot_be(self):
        self.expect(self.run_vehicle("--config", self.config, "--link", "udp:no.such.host.invalid:1"),
                    USAGE, "link: ", "no address for host \"no.such.host.invalid\"")
        taken = self.topside.getsockname()[1]
        self.expect(self.run_vehicle("--config", self.config, "--port", f"1=udp:@127.0.0.1:{taken}"),
                    USAGE, "port 1: ", "cannot listen: Address already in use")


if __name__ == "__main__":
    unittest.main()
