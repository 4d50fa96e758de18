#!/usr/bin/env python3
"""What compiled vehicle code calls and how it computes: the part of "same bits everywhere" that only the objects show.

usage: toolchain/vehicle_code_check.py [--tools PREFIX] FILE...
  FILE            archives or objects of vehicle code
  --tools PREFIX  of nm and objdump (aarch64-linux-gnu-); default: this machine's

Allowed calls out of vehicle code are listed below, everything else is a finding: the heap, exceptions, streams, and above
all libm, whose results differ from one C library to the next. Not allowed either are fused multiply-adds (one rounding
where another target has two), vector arithmetic of NEON on floats of 32-bit ARM (no denormals), and
double precision. Exit code 0: clean, 1: findings, 2: usage.
"""

import argparse
import re
import subprocess
import sys

# Copies of bytes; what compilers make of integer arithmetic and of 16-bit switches; assertions of debug builds.
ALLOWED = re.compile(
    r"^(mem(cpy|move|set|cmp|chr)|bcmp|str(len|cmp|ncmp|chr)|__stack_chk_(fail|guard)|__assert_fail|__assert_func"
    r"|__(u?(div|mod|divmod)[sdt]i[34]?|mul[sdt]i3|ash[lr][sdt]i3|lshr[sdt]i3|clz[sdt]i2|ctz[sdt]i2|popcount[sdt]i2|bswap[sd]i2)"
    r"|__aeabi_(u?(i|l)divmod|u?idiv|lmul|llsl|llsr|lasr|u?lcmp|(u?)l2f|f2(u?)lz|mem(cpy|move|set|clr)[48]?|unwind_cpp_pr[01])"
    r"|__float(un)?di[sd]f|__fix(uns)?sf[sd]i|__gnu_thumb1_case_\w+|_GLOBAL_OFFSET_TABLE_|__dso_handle"
    # The square root is IEEE 754's, the same in every library (and an instruction where errno is not asked for).
    r"|sqrtf"
    # Assertions of the standard library's containers, in debug builds.
    r"|_ZSt21__glibcxx_assert_failPKciS0_S0_)$")
OURS = re.compile(r"^_ZNK?\d*(St)?\d*N?8leadline|8leadline")
FUSED = re.compile(r"^(vfn?m(add|sub|addsub|subadd)\w*|fn?m(add|sub)|fml[as]l?2?|vfn?m[as]\w*(\.f\w+)?)$")
NEON_FLOAT = re.compile(r"^v(add|sub|mul|mla|mls|abd|max|min)\.f32$")
DOUBLE = re.compile(r"^(v?(add|sub|mul|div|sqrt|max|min)[sp]d|v(add|sub|mul|div|mla|mls|sqrt)\.f64)$")
DOUBLE_AARCH64 = re.compile(r"^f(add|sub|mul|div|sqrt|max|min|nmul)$")
LINE = re.compile(r"^\s*[0-9a-f]+:\s+(\S+)\s*(.*)$")
FUNCTION = re.compile(r"^[0-9a-f]+ <(.+)>:$")


def lines_of(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"vehicle_code_check: {' '.join(command)}: {done.stderr.strip()}")
    return done.stdout.splitlines()


def calls(tools, path):
    """Symbols that are used and not defined in any object of the file."""
    used, defined = set(), set()
    for line in lines_of(tools + "nm", path):
        words = line.split()
        if len(words) >= 2 and words[-2] in ("U", "w"):
            used.add(words[-1])
        elif len(words) == 3:
            defined.add(words[-1])
    for name in sorted(used - defined):
        if not OURS.search(name) and not ALLOWED.match(name):
            yield f"calls {name}"


def arithmetic(tools, path):
    function = "?"
    seen = set()
    for line in lines_of(tools + "objdump", "-d", "--no-show-raw-insn", path):
        begin = FUNCTION.match(line)
        if begin:
            function = begin[1]
            continue
        instruction = LINE.match(line)
        if not instruction:
            continue
        name, operands = instruction[1], instruction[2]
        why = None
        if FUSED.match(name):
            why = "fused multiply-add"
        elif NEON_FLOAT.match(name) and re.match(r"[qd]\d", operands):
            why = "vector arithmetic without denormals"
        elif DOUBLE.match(name) or (DOUBLE_AARCH64.match(name) and re.match(r"(d\d|v\d+\.2d)", operands)):
            why = "double precision"
        if why and (function, name) not in seen:
            seen.add((function, name))
            yield f"{why}: {name} {operands} in {function}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tools", default="", metavar="PREFIX")
    parser.add_argument("files", nargs="+", metavar="FILE")
    arguments = parser.parse_args()
    found = 0
    for path in arguments.files:
        for finding in (*calls(arguments.tools, path), *arithmetic(arguments.tools, path)):
            print(f"{path}: {finding}")
            found += 1
    if found == 0:
        print(f"vehicle_code_check: {len(arguments.files)} files, clean")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
