"""The options of toolchain/*.sh: each script's help and its word to an option that it does not have, and the parser that
they share (parse_options of lib.sh). Standard library only.
"""

import os
import subprocess
import tempfile
import unittest
from pathlib import Path

TOOLCHAIN = Path(os.environ.get("LEADLINE_ROOT", Path(__file__).resolve().parents[2])) / "toolchain"
SCRIPTS = sorted(path for path in TOOLCHAIN.glob("*.sh") if path.name != "lib.sh")

# Says what came out, one variable a line.
TRIAL = """#!/usr/bin/env bash
# A trial.
#
# usage: trial
set -euo pipefail
source {lib}
count=none speed=none into=none from=none what=none arch=none dry_run=0 package=()
parse_options {spec} "$@"
declare -p count speed into from what arch dry_run package operands rest | sed 's/^declare -[a-z-]* //'
"""
SPEC = "'count=number speed=decimal into=folder from=file what=text arch=arm64|armhf dry-run package+=text"


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False)


class Scripts(unittest.TestCase):
    def test_help_is_the_head_of_the_script(self):
        self.assertGreater(len(SCRIPTS), 15)
        for script in SCRIPTS:
            done = run(script, "--help")
            self.assertEqual((done.returncode, done.stderr), (0, ""), script.name)
            self.assertIn(f"usage: toolchain/{script.name}", done.stdout)

    def test_an_option_that_is_none_is_named(self):
        for script in SCRIPTS:
            done = run(script, "--nonsense")
            self.assertEqual((done.returncode, done.stdout), (2, ""), script.name)
            self.assertEqual(done.stderr, f"{script.name}: unknown option --nonsense (see --help)\n")


class Parser(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.scripts = {}
        for name, more in (("plain", ""), ("names", " NAME..."), ("command", " +COMMAND"), ("behind", " NAME... --")):
            path = Path(cls.folder.name) / name
            path.write_text(TRIAL.format(lib=TOOLCHAIN / "lib.sh", spec=SPEC + more + "'"), encoding="utf-8")
            path.chmod(0o755)
            cls.scripts[name] = path

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def taken(self, script, *arguments):
        done = run(self.scripts[script], *arguments)
        self.assertEqual((done.returncode, done.stderr), (0, ""), arguments)
        return dict(line.split("=", 1) for line in done.stdout.splitlines())

    def refused(self, script, words, *arguments):
        done = run(self.scripts[script], *arguments)
        self.assertEqual((done.returncode, done.stdout), (2, ""), arguments)
        self.assertEqual(done.stderr, f"{script}: {words} (see --help)\n")

    def test_what_is_given_arrives(self):
        folder = self.folder.name
        got = self.taken("plain", "--count", "08", "--speed=1.5", "--into", f"{folder}/a/../b", "--from",
                         self.scripts["plain"], "--what=a b=c", "--arch", "armhf", "--dry-run", "--package", "x",
                         "--package=y z")
        self.assertEqual(got["count"], '"8"')
        self.assertEqual(got["speed"], '"1.5"')
        self.assertEqual(got["into"], f'"{os.path.realpath(folder)}/b"')
        self.assertEqual(got["from"], f'"{self.scripts["plain"].resolve()}"')
        self.assertEqual(got["what"], '"a b=c"')
        self.assertEqual(got["arch"], '"armhf"')
        self.assertEqual(got["dry_run"], '"1"')
        self.assertEqual(got["package"], '([0]="x" [1]="y z")')

    def test_what_is_not_given_stays(self):
        got = self.taken("names")
        self.assertEqual(got["count"], '"none"')
        self.assertEqual((got["dry_run"], got["package"], got["operands"], got["rest"]), ('"0"', "()", "()", "()"))

    def test_operands(self):
        self.assertEqual(self.taken("names", "a", "--dry-run", "b c")["operands"], '([0]="a" [1]="b c")')
        got = self.taken("command", "--count", "3", "test", "--dry-run")
        self.assertEqual((got["operands"], got["dry_run"]), ('([0]="test" [1]="--dry-run")', '"0"'))
        got = self.taken("behind", "a", "--", "--filter=x", "b")
        self.assertEqual((got["operands"], got["rest"]), ('([0]="a")', '([0]="--filter=x" [1]="b")'))
        self.refused("plain", "unknown argument a", "a")
        self.refused("names", "unknown option --", "--", "a")

    def test_what_is_wrong_is_named(self):
        folder = self.folder.name
        self.refused("plain", "--count wants a whole number", "--count")
        for wrong in ("", "-1", "1.5", "1x", "nan", "1234567890123456789"):
            self.refused("plain", f"--count wants a whole number, not {wrong}", "--count", wrong)
        for wrong in ("", "-1", "1.", "inf"):
            self.refused("plain", f"--speed wants a number, not {wrong}", f"--speed={wrong}")
        self.refused("plain", "--into wants a folder", "--into", "")
        for wrong in (folder, folder + "/nothing"):
            self.refused("plain", f"--from: cannot read {wrong}", "--from", wrong)
        for wrong in ("", "arm", "arm64|armhf", "arm64 armhf"):
            self.refused("plain", f"--arch wants one of arm64, armhf, not {wrong}", "--arch", wrong)
        self.refused("plain", "--dry-run takes no value", "--dry-run=1")
        for wrong in ("-x", "--", "--=1", "--counts=1", "--Count"):
            self.refused("plain", f"unknown option {wrong}", wrong)


if __name__ == "__main__":
    unittest.main()
