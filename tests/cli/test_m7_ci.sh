#!/usr/bin/env bash
# The Cortex-M7: images build, hold nothing that they may not, fit their stack, and replay to the desk's bits; a
# few unit tests on the board. Skipped where the compiler for bare metal or QEMU is not installed.
set -euo pipefail
root=${LEADLINE_ROOT:-$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)}
leadline=${LEADLINE:-$root/build/release/host_tools/leadline}

if ! "$root/toolchain/setup.sh" --m7 --dry-run >/dev/null; then
  echo "*skipped*: the compiler for bare metal or QEMU is not installed (toolchain/setup.sh --m7)"
  exit 77
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() {
  echo "m7: $*" >&2
  exit 1
}

echo "== images of both memories, and their gates"
"$root/toolchain/m7.sh" gates
"$root/toolchain/m7.sh" --board stm32h743 gates

echo "== the gates bite"
cmake --build "$root/build/cortex-m7" --target m7_sins >"$scratch/log" 2>&1 || {
  cat "$scratch/log" >&2
  fail "the image full of sins does not link"
}
sins="$root/build/cortex-m7/firmware/m7_sins.elf"
for gate in symbols stack; do
  if "$root/toolchain/m7_gates.py" $gate "$sins" >"$scratch/out" 2>"$scratch/$gate"; then
    fail "$gate finds nothing wrong with an image full of sins"
  fi
done
for words in 'holds malloc' 'holds printf' 'holds _sbrk'; do
  grep -q "$words" "$scratch/symbols" || fail "symbols does not say: $words"
done
for words in 'recursive(unsigned int) calls itself' 'not a constant' 'through_pointer.*calls through a pointer'; do
  grep -q "$words" "$scratch/stack" || fail "stack does not say: $words"
done

echo "== a short flight replays to the same bits on both boards, and costs the same twice"
"$leadline" simulate --set north_count=32 --set east_count=32 --set shallowest_depth_m=12 \
  --set relief_cells=8 --out "$scratch/flight" >/dev/null
log=$(ls "$scratch"/flight/*.lll)
desk=$("$leadline" replay "$log")
for board in an500 stm32h743; do
  line=$("$root/toolchain/m7.sh" --board $board replay "$log") || true  # what is wrong shows below
  echo "$board: $line"
  for field in map_hash link_hash cells_hash; do
    value=$(grep -om1 "$field=0x[0-9a-f]*" <<<"$desk")
    grep -q "$value" <<<"$line" || fail "$board: not $value of $desk"
  done
  grep -q 'same_as_flight=true' <<<"$line" || fail "$board: not the flight's result"
  grep -Eq 'instructions_worst_ping=[1-9][0-9]* ' <<<"$line" || fail "$board: no ping was counted"
done
[ "$line" = "$("$root/toolchain/m7.sh" --board stm32h743 replay "$log")" ] ||
  fail "the same replay costs another number of instructions"

echo "== unit tests on the board"
"$root/toolchain/m7.sh" test '^unit\.(base\.(crc32c|records|status)|proto\.(cell|range_coder)|estimator\.(geodesy|pose_history)|hal\.(ping_protocol|nmea|checksums|arrival_ring)|firmware\.(config_block|config_codec|mount_pose))$' |
  tail -n 30
