"""The Debian packages of this build: what is in them, and that what they say of themselves is true. That they install and fly
in a clean system: toolchain/package.sh --try.

Environment: LEADLINE_BUILD. Standard library only.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

BUILD = pathlib.Path(os.environ["LEADLINE_BUILD"])
PROGRAMS = {"leadline-vehicle": ["leadline-vehicle", "leadline-replay"], "leadline": ["leadline"]}


def output(*command, **options):
    return subprocess.run([str(part) for part in command], check=True, stdout=subprocess.PIPE, text=True,
                          **options).stdout


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        subprocess.run(["cpack", "-G", "DEB"], cwd=BUILD, check=True, stdout=subprocess.DEVNULL)
        arch = output("dpkg", "--print-architecture").strip()
        cls.debs = {name: next((BUILD / "packages").glob(f"{name}_*_{arch}.deb")) for name in PROGRAMS}
        cls.dir = pathlib.Path(tempfile.mkdtemp(prefix="leadline-package-"))
        for name, deb in cls.debs.items():
            subprocess.run(["dpkg-deb", "-R", deb, cls.dir / name], check=True)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.dir, ignore_errors=True)

    def test_programs_run(self):
        for name, programs in PROGRAMS.items():
            for program in programs:
                done = subprocess.run([self.dir / name / "usr/bin" / program, "--help"], check=True,
                                      stdout=subprocess.PIPE, text=True)
                self.assertIn("sage", done.stdout)

    def test_nothing_lies_where_it_should_not(self):
        for name in PROGRAMS:
            for path in (self.dir / name).rglob("*"):
                shown = path.relative_to(self.dir / name).as_posix()
                self.assertRegex(shown, r"^(usr|etc|DEBIAN)(/|$)")
                self.assertFalse(path.stat().st_mode & 0o022, f"{shown}: others may write")

    def test_libraries_are_depended_on(self):
        """Every library that the programs name belongs to a package of Depends, and no other does."""
        for name, programs in PROGRAMS.items():
            depends = output("dpkg-deb", "-f", self.debs[name], "Depends")
            names = {re.sub(r"\s*\(.*", "", each.strip()) for each in depends.split(",")}
            used = {"adduser"}  # by postinst
            for program in programs:
                needed = re.findall(r"\(NEEDED\).*\[(.+)\]",
                                    output("readelf", "-d", self.dir / name / "usr/bin" / program))
                self.assertTrue(needed)
                for library in needed:
                    owners = {line.split(":")[0] for line in output("dpkg", "-S", f"*/{library}").splitlines()
                              if re.search(r"/lib/x86_64-linux-gnu/|/lib64/|/lib/aarch64-linux-gnu/", line)}
                    self.assertTrue(owners & names, f"{library} of {owners} is not in {depends}")
                    used |= owners
            self.assertFalse(names - used, f"{name} uses nothing of them")

    def test_configuration_is_the_administrators(self):
        root = self.dir / "leadline-vehicle"
        self.assertEqual((root / "DEBIAN/conffiles").read_text(), "/etc/leadline/vehicle.toml\n")
        toml = (root / "etc/leadline/vehicle.toml").read_text()
        for written in ('path = "/var/lib/leadline/survey.lll"', 'path = "/var/lib/leadline/map.llp"',
                        'counter = "/var/lib/leadline/command.key.taken"'):
            self.assertIn(written, toml)
        self.assertGreater(toml.count("#"), 50)
        for script in ["postinst", "prerm", "postrm"]:
            subprocess.run(["sh", "-n", root / "DEBIAN" / script], check=True)
            self.assertTrue(os.access(root / "DEBIAN" / script, os.X_OK))

    def test_the_service_starts_what_is_there(self):
        root = self.dir / "leadline-vehicle"
        unit = (root / "usr/lib/systemd/system/leadline-vehicle.service").read_text()
        start = re.search(r"^ExecStart=(\S+) --config (\S+)$", unit, re.M)
        self.assertTrue((root / start[1][1:]).exists())
        self.assertTrue((root / start[2][1:]).exists())
        for word in ["Type=notify", "WatchdogSec=", "Restart=on-failure", "User=leadline",
                     "SupplementaryGroups=dialout gpio", "ProtectSystem=strict"]:
            self.assertIn(word, unit)
        self.assertIn("SYMLINK", (root / "usr/lib/udev/rules.d/70-leadline.rules").read_text())


if __name__ == "__main__":
    missing = [tool for tool in ["cpack", "dpkg-deb", "dpkg-shlibdeps", "readelf"] if shutil.which(tool) is None]
    if missing:
        print(f"*skipped*: {', '.join(missing)} not installed")
        sys.exit(77)
    unittest.main()
