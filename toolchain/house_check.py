#!/usr/bin/env python3
"""Checks the house's rules on the sources: include arrows, standard headers, poisoned identifiers.

Run at configure time, in every build and as a test (tests/cli/test_house_check.py shows that every
rule bites). Standard library only. Exit code 0: clean, 1: violations (file:line: [rule] text), 2: usage.

Arrows (folder: what it may include with #include "..."):
  model/base            model/base
  model                 model
  estimator proto       themselves, model/base
  hal                   hal, model/base
  firmware              firmware, model, estimator, proto, hal
  firmware/pipeline     itself, model, estimator, proto, hal/{heads,attitude},
                        hal/{ports,wire,codec,can_frame}.hpp
  firmware/m7           itself, firmware/pipeline, model, proto, hal/m7
  firmware/config       itself, firmware/pipeline, model, proto, hal
  firmware/keys         itself, firmware/{pipeline,config}, model, proto
  host_tools            host_tools, proto, model, estimator, firmware/{pipeline,config,keys},
                        hal/{heads,attitude,linux,emu}, hal/{wire,codec,can_frame}.hpp
  tests                 anything
  toolchain             nothing of ours

Vehicle folders (model estimator proto firmware/{pipeline,m7} hal/{heads,attitude,m7}) may use only a few
standard headers, and neither heap, exceptions, RTTI, streams, floating point (estimator: float is
allowed) nor clocks. What needs an exception from this last rule says why, for a line or for a block:
  double bound = 0.5;  // house: allow double: evaluated at compile time
  // house: begin allow double: evaluated at compile time
  // house: end allow
"""

import argparse
import pathlib
import re
import sys

SOURCE_SUFFIXES = {".c", ".h", ".cpp", ".hpp", ".cc", ".hh", ".inc"}

# Longest prefix wins. None: anything.
ARROWS = {
    "model/base": ["model/base"],
    "model": ["model"],
    "estimator": ["estimator", "model/base"],
    "proto": ["proto", "model/base"],
    "hal": ["hal", "model/base"],
    "firmware": ["firmware", "model", "estimator", "proto", "hal"],
    "firmware/pipeline": [
        "firmware/pipeline", "model", "estimator", "proto", "hal/heads", "hal/attitude",
        "hal/ports.hpp", "hal/wire.hpp", "hal/codec.hpp", "hal/can_frame.hpp",
        "hal/angles.hpp", "hal/checksums.hpp", "hal/text_fields.hpp",
    ],
    "firmware/m7": ["firmware/m7", "firmware/pipeline", "model", "proto", "hal/m7"],
    "firmware/config": ["firmware/config", "firmware/pipeline", "model", "proto", "hal"],
    "firmware/keys": ["firmware/keys", "firmware/config", "firmware/pipeline", "model", "proto"],
    "host_tools": [
        "host_tools", "proto", "model", "estimator", "firmware/pipeline", "firmware/config",
        "firmware/keys", "hal/heads", "hal/attitude", "hal/linux", "hal/emu",
        "hal/wire.hpp", "hal/codec.hpp", "hal/can_frame.hpp", "hal/text_fields.hpp",
    ],
    "tests": None,
    "toolchain": ["toolchain"],
}

VEHICLE = [
    "model", "estimator", "proto", "firmware/pipeline", "hal/heads", "hal/attitude",
    "firmware/m7", "hal/m7", "hal/angles.hpp", "hal/can_frame.hpp", "hal/checksums.hpp", "hal/codec.hpp", "hal/ports.hpp",
    "hal/text_fields.hpp", "hal/wire.hpp",
]

# Freestanding or trivially inlined, none of them allocates or throws in the parts that we use.
STD_HEADERS = {
    "algorithm", "array", "cstddef", "cstdint", "cstring", "limits", "optional", "type_traits",
    "utility",
}
# Folder -> further headers.
# atomic: the single-producer ring. new: a port's codec is constructed in the port's own storage.
# Eigen: fixed sizes only, behind estimator/filter_access.hpp. stdint.h: saturating.h is C as well.
STD_HEADERS_EXTRA = {
    "estimator": {"cmath", "Eigen/Core"}, "firmware/pipeline": {"new"}, "model/base": {"atomic", "stdint.h"},
}
# Intrinsics only in files whose name says so: the portable form stays readable beside them.
KERNEL_FILE = re.compile(r"(^|_)kernels?(_[a-z0-9]+)?\.(cpp|hpp)$")
KERNEL_HEADERS = {
    "arm_acle.h", "arm_neon.h", "emmintrin.h", "immintrin.h", "smmintrin.h", "tmmintrin.h",
}

# (name for the allow tag, pattern, why)
POISON = [
    ("malloc", r"\b(?:malloc|calloc|realloc|aligned_alloc|strdup|alloca)\b", "no heap"),
    ("free", r"(?<![\w.>])(?:std::)?free\s*\(", "no heap"),
    ("new", r"\bnew\b", "no heap"),
    # "= delete;" declares; a delete-expression has an operand.
    ("delete", r"\bdelete\b(?!\s*;)", "no heap"),
    ("throw", r"\bthrow\b", "no exceptions"),
    ("try", r"\btry\b|\bcatch\b", "no exceptions"),
    ("rtti", r"\b(?:dynamic_cast|typeid)\b", "no RTTI"),
    ("std-heap",
     r"\bstd::(?:vector|string|wstring|deque|list|forward_list|map|multimap|set|multiset|"
     r"unordered_\w+|function|any|shared_ptr|unique_ptr|make_shared|make_unique|weak_ptr|"
     r"stringstream|ostringstream|istringstream|to_string|valarray|regex)\b", "no heap"),
    ("streams", r"\bstd::(?:cout|cerr|clog|cin|ostream|istream|fstream|ofstream|ifstream|endl)\b",
     "no streams"),
    ("stdio", r"\b(?:printf|fprintf|sprintf|snprintf|puts|fopen|fwrite|fread)\b", "no stdio"),
    ("clock", r"\b(?:std::chrono|clock_gettime|gettimeofday|std::time)\b",
     "time is passed in, never read"),
    ("thread", r"\bstd::(?:thread|mutex|async|condition_variable)\b|\bthread_local\b",
     "no threads in the core"),
    ("random", r"\b(?:std::)?(?:rand|srand|random_device)\b\s*\(", "results must repeat"),
    ("double", r"\bdouble\b", "integer arithmetic on the vehicle"),
    ("float", r"\bfloat\b", "integer arithmetic on the vehicle"),
    # 1.5, 1e3, 2.f: a literal betrays floating point that no type name shows (auto).
    ("float-literal",
     r"(?<![\w.])(?!0[xX])(?:\d[\d']*\.[\d']*(?:[eE][+-]?\d+)?|\.\d[\d']*(?:[eE][+-]?\d+)?|"
     r"\d[\d']*[eE][+-]?\d+)[fFlL]?(?![\w.])", "integer arithmetic on the vehicle"),
    ("goto", r"\bgoto\b|\bsetjmp\b|\blongjmp\b", "straight control flow"),
]
# Most lines hold none: one look at all together.
ANY_POISON = re.compile("|".join(f"(?:{pattern})" for _, pattern, _ in POISON))
POISON = [(name, re.compile(pattern), why) for name, pattern, why in POISON]
# Folder -> poisons that do not apply.
POISON_EXEMPT = {"estimator": {"float", "float-literal"}}

ALLOW_TAG = re.compile(r"//\s*house:\s*(begin\s+)?allow\s+([\w, -]+?)\s*:\s*(\S.*)?$")
ALLOW_END = re.compile(r"//\s*house:\s*end\s+allow\b")
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]*)"|<([^>]*)>|(\S.*))')
TOP_LEVEL = {
    "CMakeLists.txt", "CMakePresets.json", "LICENSE", "CHANGELOG.md", "README.md", "firmware",
    "hal", "model", "estimator", "proto", "host_tools", "tests", "toolchain",
}
TOP_LEVEL_UNTRACKED = {"build", "out"}  # what our own scripts leave behind, in .gitignore


def longest_prefix(path, prefixes):
    """The longest of prefixes that is path itself or a parent of it, or None."""
    hits = [p for p in prefixes if path == p or path.startswith(p + "/")]
    return max(hits, key=len) if hits else None


LITERAL_OR_COMMENT = re.compile(r"""//|/\*|["']""")
# A backslash at the end of the line continues the comment.
COMMENT_END = re.compile(r"(?<!\\)\n")
NOT_LINE_BREAK = re.compile(r"[^\n]")


def blank_comments_and_literals(text):
    """Same text, same line breaks; comments, strings and characters become blanks."""
    out = []
    i = 0
    size = len(text)
    while i < size:
        match = LITERAL_OR_COMMENT.search(text, i)
        start = match.start() if match else size
        out.append(text[i:start])
        if not match:
            break
        i = start
        token = match[0]
        if token == "//":
            line_end = COMMENT_END.search(text, i)
            end = line_end.start() if line_end else size
        elif token == "/*":
            end = text.find("*/", i + 2)
            end = size if end < 0 else end + 2
        elif text[i] == '"' and i > 0 and text[i - 1] == "R":
            delimiter = text[i + 1:text.find("(", i)]
            end = text.find(")" + delimiter + '"', i)
            end = size if end < 0 else end + len(delimiter) + 2
        elif text[i] == '"' or (text[i] == "'" and not (i > 0 and text[i - 1].isalnum())):
            # A ' after a letter or digit separates digits: 1'000.
            end = i + 1
            while end < size and text[end] != text[i] and text[end] != "\n":
                end += 2 if text[end] == "\\" else 1
            end += 1
        else:
            out.append(text[i])
            i += 1
            continue
        out.append(NOT_LINE_BREAK.sub(" ", text[i:end]))
        i = end
    return "".join(out)


INCLUDE_DIRECTIVE = re.compile(r"\s*#\s*include\b")


class Checker:
    def __init__(self, root):
        self.root = root
        self.problems = []

    def report(self, path, line, rule, text):
        self.problems.append((path, line, rule, text))

    def check(self):
        for entry in sorted(self.root.iterdir()):
            name = entry.name
            if name.startswith(".") or name in TOP_LEVEL_UNTRACKED or name in TOP_LEVEL:
                continue
            self.report(name, 1, "top-level", "not one of the agreed top-level names")
        for folder in sorted({p.split("/")[0] for p in ARROWS}):
            base = self.root / folder
            if not base.is_dir():
                continue
            for file in sorted(base.rglob("*")):
                if file.suffix in SOURCE_SUFFIXES and file.is_file():
                    self.check_file(file)
        return self.problems

    def check_file(self, file):
        path = file.relative_to(self.root).as_posix()
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            self.report(path, 1, "encoding", "not UTF-8")
            return
        arrow_room = longest_prefix(path, ARROWS)
        vehicle_room = longest_prefix(path, VEHICLE)
        originals = text.split("\n")
        blanked = blank_comments_and_literals(text).split("\n")
        for number, code in enumerate(blanked, 1):
            # The line as it was: an #include's "..." is a literal.
            if "include" not in code:
                continue
            match = INCLUDE.match(originals[number - 1] if INCLUDE_DIRECTIVE.match(code) else code)
            if match:
                self.check_include(path, number, match, arrow_room, vehicle_room)
        if vehicle_room:
            self.check_poison(path, originals, blanked, vehicle_room)

    def check_include(self, path, number, match, arrow_room, vehicle_room):
        quoted, angled, computed = match.groups()
        if computed is not None:
            self.report(path, number, "include-form", "computed #include hides the arrow")
            return
        target = quoted if quoted is not None else angled
        # By name, not by existence: a header that is missing is the compiler's to report.
        ours = ".." not in target.split("/") and longest_prefix(target, ARROWS) is not None
        if quoted is not None:
            if not ours:
                self.report(path, number, "include-form",
                            f'"{target}" does not start at one of our folders '
                            '(ours: "folder/file.hpp"; others: <file>)')
                return
        elif ours and (self.root / target).is_file():
            self.report(path, number, "include-form", f"<{target}> is ours: write it in quotes")
            return
        if quoted is not None:
            allowed = ARROWS[arrow_room]
            if allowed is not None and longest_prefix(target, allowed) is None:
                self.report(path, number, "include-arrow",
                            f'{arrow_room} must not include "{target}" '
                            f"(allowed: {', '.join(allowed)})")
            return
        if vehicle_room:
            extra = STD_HEADERS_EXTRA.get(vehicle_room, set()) | STD_HEADERS_EXTRA.get(arrow_room, set())
            if target in STD_HEADERS or target in extra:
                return
            if target in KERNEL_HEADERS:
                if not KERNEL_FILE.search(path.rsplit("/", 1)[-1]):
                    self.report(path, number, "std-header",
                                f"<{target}> only in files named *kernel*.cpp/.hpp")
                return
            self.report(path, number, "std-header",
                        f"<{target}> is not on the allow-list of vehicle code")

    def check_poison(self, path, originals, blanked, room):
        exempt = POISON_EXEMPT.get(room, set())
        block, block_line, block_used = set(), 0, set()
        for number, code in enumerate(blanked, 1):
            if INCLUDE_DIRECTIVE.match(code):
                continue
            if ALLOW_END.search(originals[number - 1]):
                self.check_block_end(path, number, block, block_line, block_used)
                block, block_line, block_used = set(), 0, set()
                continue
            allowed, begins = self.read_allow_tag(path, number, originals[number - 1])
            if begins:
                if block_line:
                    self.report(path, number, "allow-tag",
                                f"the block of line {block_line} has no end")
                block, block_line, block_used = allowed, number, set()
                continue
            if not allowed and not ANY_POISON.search(code):
                continue
            for name, pattern, why in POISON:
                if name in exempt:
                    continue
                hit = pattern.search(code)
                if name == "float-literal" and {"double", "float"} & (allowed | block):
                    continue  # who may say double may say 0.5
                if hit and name in block:
                    block_used.add(name)
                elif hit and name not in allowed:
                    self.report(path, number, f"poison-{name}",
                                f"'{hit.group(0).strip()}': {why} (an exception needs its reason: "
                                f"// house: allow {name}: ...)")
                elif not hit and name in allowed:
                    self.report(path, number, "allow-tag", f"'{name}' is not on this line")
        if block_line:
            self.report(path, block_line, "allow-tag", "the block has no end")

    def read_allow_tag(self, path, number, line):
        """Names that the line's tag allows, and whether it begins a block."""
        tag = ALLOW_TAG.search(line)
        if not tag:
            return set(), False
        names = {word.strip() for word in tag.group(2).split(",")}
        if not tag.group(3):
            self.report(path, number, "allow-tag", "the tag gives no reason")
        unknown = names - {name for name, _, _ in POISON}
        if unknown:
            self.report(path, number, "allow-tag", f"unknown rule: {', '.join(sorted(unknown))}")
        return names, tag.group(1) is not None

    def check_block_end(self, path, number, block, block_line, used):
        if not block_line:
            self.report(path, number, "allow-tag", "an end without a beginning")
        for name in sorted(block - used):
            self.report(path, block_line, "allow-tag", f"'{name}' is not in this block")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=pathlib.Path,
                        default=pathlib.Path(__file__).resolve().parent.parent,
                        help="project root (default: the one this script is in)")
    parser.add_argument("--quiet", action="store_true", help="say nothing when clean")
    parser.add_argument("--warn", action="store_true", help="show violations, but exit with 0")
    arguments = parser.parse_args()
    if not arguments.root.is_dir():
        parser.error(f"{arguments.root} is not a folder")
    problems = Checker(arguments.root.resolve()).check()
    for path, line, rule, text in problems:
        print(f"{path}:{line}: [{rule}] {text}", file=sys.stderr)
    if problems:
        print(f"house_check: {len(problems)} violation(s)", file=sys.stderr)
        return 0 if arguments.warn else 1
    if not arguments.quiet:
        print("house_check: clean")
    return 0


if __name__ == "__main__":
    sys.exit(main())
