#!/usr/bin/env bash
# CAN and GPIO ports on a real kernel: runs unit.hal_linux.kernel_buses inside of a Linux that is itself a
# plain process. Debian's packaged one (user-mode-linux) brings CAN; that of toolchain/user_mode_kernel.sh,
# where it has been built, CAN and GPIO. Skipped where there is neither.
set -euo pipefail
source "$LEADLINE_ROOT/tests/cli/support/user_mode_guest.sh"

program=$LEADLINE_BUILD/tests/unit.hal_linux.kernel_buses
built=$("$LEADLINE_ROOT/toolchain/user_mode_kernel.sh" --print-path)
packaged=$(command -v linux.uml || true)
PATH=$PATH:/usr/sbin:/sbin command -v ip >/dev/null || skip "no ip: apt-get install iproute2"
[ -x "$program" ] || skip "$program has not been built"
if [ -x "$built" ]; then
  kernel=$built
  # Everything but nothing is there: a skipped test would hide a broken guest.
  needed="edges_come a_trigger frames_go bus_off an_adapter"
elif [ -n "$packaged" ]; then
  command -v insmod >/dev/null || PATH=$PATH:/usr/sbin:/sbin command -v insmod >/dev/null ||
    skip "no insmod for the packaged kernel's modules: apt-get install kmod"
  kernel=$packaged
  needed="frames_go bus_off"
  echo "GPIO: *skipped*: no kernel with lines (toolchain/user_mode_kernel.sh builds one)"
else
  skip "no user-mode kernel: apt-get install user-mode-linux, or toolchain/user_mode_kernel.sh"
fi

run_guest "$kernel" kernel_buses_init.sh "LEADLINE_TEST=$program"
for name in $needed; do
  grep -q "OK \] $name" "$guest_log" || { echo "$name... did not run"; exit 1; }
done
grep -q '^GUEST-RC=0$' "$guest_log"
