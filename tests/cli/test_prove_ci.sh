#!/usr/bin/env bash
# The kernels' contracts are proved, and a kernel that breaks one is not.
set -euo pipefail
prove=$LEADLINE_ROOT/toolchain/prove.sh
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

"$prove"

# Without the limit the sum of two halves does not fit 16 bits.
sed 's/sum > 0xFFFFU ? 0xFFFFU : sum/sum/' "$LEADLINE_ROOT/model/base/saturating.h" >"$scratch/broken.h"
! cmp -s "$scratch/broken.h" "$LEADLINE_ROOT/model/base/saturating.h" || {
  echo "the header no longer has the line that this test breaks"
  exit 1
}
if "$prove" --seconds 2 "$scratch/broken.h" >"$scratch/log" 2>&1; then
  cat "$scratch/log"
  echo "a kernel without its limit was proved"
  exit 1
fi
grep -q '^prove: [0-9]* of 7' "$scratch/log" || { cat "$scratch/log"; exit 1; }
