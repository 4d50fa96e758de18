#!/usr/bin/env bash
# Proves the integer kernels under the voxels (model/base/saturating.h) with Frama-C's WP: for every input
# that a contract admits, nothing overflows (signed or unsigned), divides by zero or shifts too far, and the
# result is what the contract says.
#
# usage: toolchain/prove.sh [--seconds N] [HEADER]
#   --seconds N for each goal at most (default 60: a proof takes less than one on a quiet machine)
#   HEADER      another version of it (a test sees a broken one fail)
#
# Proved are the C functions of that header, which the model's scalar kernels call: saturating sums, the
# rounding of evidence to units, the pulling rules, the multiply-and-shift, the step of the square root.
# Not proved: that callers keep the contracts (the ranges stand where the values are made, and UBSan runs
# over all tests), the vector forms (tests compare them with the scalar ones bit by bit), the geometry, and
# that >> of a negative number rounds down, which C leaves to the compiler and gcc and clang promise.
#
# Needs frama-c-base, why3 and z3 (Debian). Exit code 0: everything proved; 1: something is not;
# 77: a tool is missing.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

seconds=60
parse_options 'seconds=number HEADER' "$@"
header=${operands[0]:-$root/model/base/saturating.h}
[ -r "$header" ] || usage_error "cannot read $header"
for tool in frama-c why3 z3; do
  command -v "$tool" >/dev/null || {
    echo "skipped: $tool is not installed (apt-get install frama-c-base why3 z3)"
    exit 77
  }
done

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
# Frama-C takes files that end in .c, and why3 its list of provers from a file of its own.
cp "$header" "$scratch/saturating.c"
export HOME=$scratch
why3 config detect >/dev/null 2>&1 || die "why3 finds no prover"
cd "$scratch"
if ! frama-c -wp -wp-rte -warn-unsigned-overflow -wp-prover z3 \
  -wp-timeout "$seconds" -wp-par "$jobs" saturating.c >log 2>&1; then
  cat log
  die "frama-c failed"
fi
grep -E 'Failed|Timeout|Unknown|Unsuccess|warning' log || true
proved=$(sed -n 's/^\[wp\] Proved goals: *\([0-9]*\) *\/ *\([0-9]*\).*/\1 \2/p' log)
functions=$(grep -c '^LEADLINE_KERNEL' saturating.c)
read -r have of <<<"${proved:-0 0}"
echo "prove: $have of $of goals of $functions functions"
[ "$of" -gt 0 ] && [ "$have" -eq "$of" ]
