#!/bin/sh
# First process of the user-mode kernel of test_real_time_kernel_ci.sh. On the kernel's command line: LEADLINE_VEHICLE
# (program), LEADLINE_CONFIG (folder: vehicle.toml, beam.llt), LEADLINE_UNIT.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
echo GUEST-STARTED
mount -t proc proc /proc
# Not over /tmp: the checkout may lie there.
mount -t tmpfs -o mode=1777 tmp /mnt
ip link set lo up

end() {
  [ $# -eq 1 ] || { echo "$2" && cat /mnt/said; }
  echo "GUEST-RC=$1"
  poweroff -f 2>/dev/null || echo o >/proc/sysrq-trigger
  sleep 5
  exit "$1"
}
fail() { end 1 "$1"; }
limit() { sed -n "s/^$1=//p" "$LEADLINE_UNIT" | sed 's/infinity/unlimited/'; }
# wait_for COMMAND...
wait_for() {
  left=600
  until "$@"; do
    [ $left -gt 0 ] || fail "in vain: $*"
    left=$((left - 1))
    sleep 0.1
  done
}
status() { sed -n "s/^$1:[[:space:]]*\([^ ]*\).*/\1/p" "/proc/$pid/status"; }
# Priority and policy of a thread: fields 40 and 41 of its stat, counted behind the name. 1 is SCHED_FIFO.
scheduling() { sed 's/.*) //' "/proc/$pid/task/$1/stat" | cut -d' ' -f38,39; }
has_threads() { [ "$(find "/proc/$pid/task" -mindepth 1 -maxdepth 1 | wc -l)" -ge 2 ]; }
# start LIMITS...
start() {
  prlimit "$@" setpriv --reuid nobody --regid nogroup --clear-groups --bounding-set=-all --no-new-privs \
    /mnt/leadline-vehicle --config vehicle.toml >/mnt/summary 2>/mnt/said &
  pid=$!
  wait_for grep -q 'link .* open' /mnt/said
  wait_for has_threads
  echo "$*: $(grep memory /mnt/said); locked $(status VmLck) of $(status VmRSS) kB, capabilities $(status CapEff)"
  [ "$(status CapEff)" = 0000000000000000 ] || fail "it has capabilities"
}
stop() {
  kill -TERM $pid
  wait $pid || fail "it does not stop in order"
}

cd /mnt || exit
# Copies: that user need not be let into the checkout.
cp "$LEADLINE_VEHICLE" "$LEADLINE_CONFIG"/* /mnt

start --memlock="$(limit LimitMEMLOCK)" --rtprio="$(limit LimitRTPRIO)"
grep -q 'memory locked, SCHED_FIFO 20$' said || fail "it does not have what the unit allows"
[ "$(status VmLck)" -ge 1000 ] || fail "nothing is locked"
[ "$(scheduling $pid)" = "20 1" ] || fail "the cycle's thread: $(scheduling $pid)"
for task in /proc/$pid/task/*; do
  thread=${task##*/}
  [ "$thread" = $pid ] || [ "$(scheduling "$thread")" = "0 0" ] || fail "another thread: $(scheduling "$thread")"
done
stop
start --memlock=65536 --rtprio=0
grep -q 'memory not locked: .*, ordinary scheduling: ' said || fail "it does not say what it lacks"
[ "$(status VmLck)" = 0 ] && [ "$(scheduling $pid)" = "0 0" ] || fail "it has what it may not"
stop
end 0
