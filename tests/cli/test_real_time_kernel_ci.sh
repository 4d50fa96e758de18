#!/usr/bin/env bash
# The limits of the systemd unit at work: under a Linux that is itself a plain process (this machine may not raise limits), as
# a user without a capability, leadline-vehicle locks its memory and gets SCHED_FIFO with LimitMEMLOCK and LimitRTPRIO
# as the unit has them, its other threads stay ordinary, and without them it says that it has neither and flies on.
set -euo pipefail
source "$LEADLINE_ROOT/tests/cli/support/user_mode_guest.sh"

kernel=$(command -v linux.uml || "$LEADLINE_ROOT/toolchain/user_mode_kernel.sh" --print-path)
[ -x "$kernel" ] || skip "no user-mode kernel: apt-get install user-mode-linux, or toolchain/user_mode_kernel.sh"
for tool in prlimit setpriv; do
  command -v $tool >/dev/null || skip "no $tool: apt-get install util-linux"
done
config=$guest_work/config
"$LEADLINE" emulate --write-config "$config" --ports "$config/ports" --link udp:127.0.0.1:9100 >/dev/null
cp "$LEADLINE_ROOT/tests/data/small_vehicle.toml" "$config/vehicle.toml"
run_guest "$kernel" real_time_init.sh "LEADLINE_VEHICLE=$LEADLINE_VEHICLE" "LEADLINE_CONFIG=$config" \
  "LEADLINE_UNIT=$LEADLINE_ROOT/toolchain/packaging/leadline-vehicle.service"
grep -q '^GUEST-RC=0$' "$guest_log"
