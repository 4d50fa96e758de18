#!/usr/bin/env python3
"""What an image for the Cortex-M7 may not hold, and how deep its stack can go; from the linked image alone.

usage: toolchain/m7_gates.py symbols IMAGE      no heap, exception, RTTI or stdio symbol
       toolchain/m7_gates.py stack IMAGE        the deepest path of calls fits the stack that the linker reserved
       toolchain/m7_gates.py footprint IMAGE    bytes by section and region, as a Markdown table

Frames and calls are read out of the instructions, so that what the compiler's library brings counts as well
(-fstack-usage and -fcallgraph-info know our own sources only, and a compiler cache forgets them). The depth is an
upper bound: every push and every step of the stack pointer in a function counts, a tail call keeps its caller's
frame, an interrupt comes at the deepest place. Recursion, a frame whose size is not a constant, and a call through
a pointer that POINTERS below does not name are errors. Exit code 0: passed, 1: not, 2: usage.
"""

import re
import subprocess
import sys

TOOLS = "arm-none-eabi-"

# Mangled or plain names that have no place in an image that flies.
FORBIDDEN = re.compile(
    r"^(_?(malloc|calloc|realloc|free|memalign|sbrk|mallinfo)(_r)?"
    r"|_(malloc|calloc|realloc|free)_r|_sbrk|_sbrk_r|__malloc.*"
    r"|_Zn[wa].*|_Zd[la].*"                               # operator new, new[], delete, delete[]
    r"|__cxa_(throw|rethrow|begin_catch|end_catch|allocate_exception|bad_cast|bad_typeid|guard_.*"
    r"|atexit|pure_virtual|deleted_virtual|call_unexpected)"
    r"|__gxx_personality.*|__aeabi_unwind_cpp_pr[0-9]|_Unwind_.*|__gnu_unwind.*|_ZSt9terminatev"
    r"|_ZT[IS].*|__dynamic_cast|_ZTVN10__cxxabiv1.*"      # type information
    r"|_?(v|f|s|sn|as|d|vf|vs|vsn|vas)?i?printf(_r)?|_?v?f?scanf(_r)?|f?puts(_r)?|putchar(_r)?"
    r"|f(open|close|read|write|flush|seek)(_r)?|__sf.*|__sinit|_ZNSt8ios_base.*|_ZSt4cout"
    r"|abort|__assert_func|_impure_ptr|__errno)$")

# Who calls through a pointer, and whom (both by demangled name): a class's static tables.
POINTERS = [
    (r"^leadline::firmware::PortCodec::(configure|configure_decoding)\(",
     r"Calls<.*>::(make|make_default)\("),
    (r"^leadline::firmware::PortCodec::feed\(", r"Calls<.*>::feed\("),
    (r"^leadline::firmware::PortCodec::next\(", r"Calls<.*>::(next|sample)\("),
    (r"^leadline::firmware::PortCodec::request\(", r"Calls<.*>::request\("),
    (r"^leadline::firmware::PortCodec::restart\(", r"Calls<.*>::restart\("),
    (r"^leadline::firmware::PortCodec::(counters|rejected)\(", r"Calls<.*>::counters\("),
    (r"^leadline::hal::KellerCodec::next\(", r"^leadline::hal::.*judge_(modbus|keller_bus)\("),
    (r"^leadline_reset$", r"^_GLOBAL__sub_I_|^global constructors"),
]
ENTRY = "leadline_reset"
INTERRUPTS = r"^leadline_(uart\d_(receive|sent)|tick)$"
EXCEPTION_FRAME_bytes = 108  # 26 words with floating point, 4 to align
# A failure leaves this path for a stack of its own and does not come back.
IGNORED = {"leadline_fault_entry", "leadline_fault"}


def run(*arguments):
    return subprocess.run(arguments, check=True, capture_output=True, text=True).stdout


def symbols(image):
    table = {}
    for line in run(TOOLS + "nm", image).splitlines():
        parts = line.split()
        if len(parts) == 3:
            table[parts[2]] = (int(parts[0], 16), parts[1])
    return table


def demangled(names):
    names = list(names)
    text = subprocess.run([TOOLS + "c++filt"], input="\n".join(names), check=True,
                          capture_output=True, text=True).stdout
    return dict(zip(names, text.split("\n")))


def check_symbols(image):
    found = sorted(name for name in symbols(image) if FORBIDDEN.match(name))
    plain = demangled(found)
    for name in found:
        print(f"{image}: holds {plain[name]} ({name})", file=sys.stderr)
    if not found:
        print(f"{image}: no heap, exception, RTTI or stdio symbol")
    return 1 if found else 0


def register_count(text):
    """Of "{r4, r5-r7, lr}" or "{d8-d11}"."""
    count = 0
    for part in re.search(r"\{(.*)\}", text).group(1).split(","):
        ends = re.findall(r"(\d+)", part)
        if "-" in part and len(ends) == 2:
            count += int(ends[1]) - int(ends[0]) + 1
        else:
            count += 1
    return count


def number(text):
    match = re.search(r"#(-?(?:0x[0-9a-f]+|\d+))", text)
    return int(match.group(1), 0) if match else None


class Function:
    def __init__(self, name):
        self.name = name
        self.frame = 0
        self.calls = set()
        self.through_pointer = False
        self.faults = []


def read_functions(image):
    starts = {}
    for name, (address, kind) in symbols(image).items():
        if kind in "tTwW" and not name.startswith("$"):
            starts.setdefault(address & ~1, name)
    functions = {}
    current = None
    constants = {}
    for line in run(TOOLS + "objdump", "-d", "--no-show-raw-insn", image).splitlines():
        match = re.match(r"^([0-9a-f]{8}) <(.+)>:$", line)
        if match:
            name = starts.get(int(match.group(1), 16), match.group(2))
            current = functions.setdefault(name, Function(name))
            constants = {}
            continue
        match = re.match(r"^\s*[0-9a-f]+:\t(\S+)(?:\t(.*))?$", line)
        if match and current:
            read_instruction(current, match.group(1), match.group(2) or "", constants, starts)
    return functions


def read_instruction(function, operation, operands, constants, starts):
    base = operation.split(".")[0]
    target = re.match(r"(?:\w+, )?([0-9a-f]+) <([^>+]+)(\+0x[0-9a-f]+)?>", operands)
    if base in ("push", "vpush") or (base in ("stmdb", "vstmdb") and operands.startswith("sp!")):
        wide = 8 if re.search(r"\{d", operands) else 4
        function.frame += wide * register_count(operands)
    elif base in ("sub", "subw") and operands.startswith("sp"):
        step = number(operands)
        source = operands.split(",")[-1].strip()
        if step is None:
            step = constants.get(source)
        if step is None:
            function.faults.append(f"a frame whose size is not a constant: {operation} {operands}")
        else:
            function.frame += step
    elif base.startswith(("str", "vstr")) and re.search(r"\[sp, #-\d+\]!", operands):
        function.frame += -number(operands)
    elif base in ("mov", "movw") and re.match(r"(ip|r\d+), #", operands):
        constants[operands.split(",")[0]] = number(operands)
    elif base == "movt":
        register = operands.split(",")[0]
        constants[register] = constants.get(register, 0) | number(operands) << 16
    elif base.startswith("mov") and operands.startswith("sp,"):
        function.faults.append(f"the stack pointer is set: {operation} {operands}")
    elif base in ("blx", "bx") and re.match(r"(r\d+|ip|fp|sl|lr)$", operands.split(";")[0].strip()):
        if not (base == "bx" and operands.startswith("lr")):
            function.through_pointer = True
    elif base.startswith("b") and target and base not in ("bfi", "bfc", "bic", "bkpt"):
        address = int(target.group(1), 16)
        # A branch within the function has an offset from its name; a tail call has none, or another's name.
        name = starts.get(address, target.group(2))
        if base in ("bl", "blx") or (target.group(3) is None and name != function.name) or \
                target.group(2) not in (function.name, name):
            function.calls.add(name)


class Stack:
    def __init__(self, functions):
        self.functions = functions
        self.plain = demangled(functions)
        self.known = {}
        self.open = []
        self.errors = []
        self.pointers = 0
        for function in functions.values():
            if function.through_pointer:
                self.follow_pointer(function)

    def follow_pointer(self, function):
        plain = self.plain[function.name]
        for caller, callee in POINTERS:
            if re.search(caller, plain):
                targets = [n for n in self.functions if re.search(callee, self.plain[n])]
                if targets:
                    function.calls.update(targets)
                    self.pointers += 1
                    return
        self.errors.append(f"{plain}: calls through a pointer, and POINTERS does not say whom")

    def depth(self, name):
        """(bytes, path) of the deepest calls from here."""
        if name in IGNORED or name not in self.functions:
            return 0, []
        if name in self.known:
            return self.known[name]
        if name in self.open:
            self.errors.append("recursion: " + " > ".join(
                self.plain[n] for n in self.open[self.open.index(name):] + [name]))
            return 0, []
        function = self.functions[name]
        for fault in function.faults:
            self.errors.append(f"{self.plain[name]}: {fault}")
        self.open.append(name)
        best = max((self.depth(callee) for callee in sorted(function.calls) if callee != name),
                   default=(0, []))
        if name in function.calls:
            self.errors.append(f"recursion: {self.plain[name]} calls itself")
        self.open.pop()
        self.known[name] = (function.frame + best[0], [(function.frame, name)] + best[1])
        return self.known[name]


def check_stack(image):
    table = symbols(image)
    reserved = table["leadline_stack_top"][0] - table["leadline_stack_low"][0]
    functions = read_functions(image)
    stack = Stack(functions)
    deepest, path = stack.depth(ENTRY)
    interrupts = [stack.depth(n) for n in sorted(functions) if re.match(INTERRUPTS, n)]
    interrupt = EXCEPTION_FRAME_bytes + max((each[0] for each in interrupts), default=0)
    total = deepest + interrupt
    print(f"{image}: deepest {deepest} bytes and an interrupt of {interrupt}: {total} of {reserved} "
          f"reserved, {100 * (reserved - total) // reserved} % left; {len(functions)} functions, "
          f"{stack.pointers} that call through pointers")
    for frame, name in path:
        print(f"  {frame:6d}  {stack.plain[name][:100]}")
    if total > reserved:
        stack.errors.append(f"the stack of {reserved} bytes is {total - reserved} too small")
    for error in stack.errors:
        print(f"{image}: {error}", file=sys.stderr)
    return 1 if stack.errors else 0


FLASH = {".text", ".ARM.exidx", ".ARM.extab", ".init_array", ".data"}
WHAT = {
    ".text": "code and constants", ".data": "initialized data (flash and RAM)",
    ".stack": "stack", ".fault_stack": "stack of the fault handler", ".noinit": "fault record",
    ".voxels": "voxels", ".columns": "columns", ".results": "depths", ".vehicle": "vehicle, the rest",
    ".lines": "lines and their rings", ".bss": "other data", ".tools": "of tools, not of the vehicle",
}


def footprint(image):
    print("| section | at | bytes | what |\n|---|---|---:|---|")
    flash = ram = 0
    for line in run(TOOLS + "size", "-A", "-x", image).splitlines():
        parts = line.split()
        if len(parts) != 3 or parts[0] not in WHAT or int(parts[1], 16) == 0:
            continue
        size, address = int(parts[1], 16), int(parts[2], 16)
        flash += size if parts[0] in FLASH else 0
        ram += size if parts[0] not in FLASH or parts[0] == ".data" else 0
        print(f"| `{parts[0]}` | 0x{address:08X} | {size:,} | {WHAT[parts[0]]} |")
    print(f"| all | flash | {flash:,} | |\n| all | RAM | {ram:,} | |")
    return 0


COMMANDS = {"symbols": check_symbols, "stack": check_stack, "footprint": footprint}


def main():
    if len(sys.argv) == 2 and sys.argv[1] in ("-h", "--help"):
        print(__doc__)
        return 0
    if len(sys.argv) != 3 or sys.argv[1] not in COMMANDS:
        print(__doc__, file=sys.stderr)
        return 2
    return COMMANDS[sys.argv[1]](sys.argv[2])


if __name__ == "__main__":
    sys.setrecursionlimit(10000)
    sys.exit(main())
