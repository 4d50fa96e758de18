#!/bin/sh
# Tries the service under a systemd of its own; toolchain/package.sh --try boots a container with it (systemd-nspawn). Both
# packages are installed; /opt/small_vehicle.toml is a configuration, /opt/next.deb the vehicle's next version. /opt/trial
# receives what was found: its last line is `held`, or what did not.
exec >/opt/trial 2>&1
set -u
unit=leadline-vehicle.service
fail() {
  systemctl status --no-pager --full $unit
  journalctl --no-pager -n 30 -u $unit
  echo "$1"
  systemctl poweroff --no-block
  exit 1
}
value() { systemctl show --value -p "$1" $unit; }
# wait_for SECONDS COMMAND...
wait_for() {
  left=$1
  shift
  until "$@"; do
    [ "$left" -gt 0 ] || return 1
    left=$((left - 1))
    sleep 1
  done
}
restarted() { [ "$(value NRestarts)" -ge "$1" ] && [ "$(value ActiveState)" = active ]; }

cd /etc/leadline || exit
leadline emulate --set north_count=40 --set east_count=40 --write-config /tmp/emulated --ports /tmp/ports --link udp:127.0.0.1:9100
cp /tmp/emulated/beam.llt .
sed 's|serial:not-there|serial:/dev/leadline/by-serial/none-00|; s|survey.lll|/var/lib/leadline/&|' /opt/small_vehicle.toml >vehicle.toml
cat >>vehicle.toml <<TOML
[[port]]
uri = "udp:@:9200"
driver = "nmea"
TOML

[ "$(systemctl is-enabled $unit)" = disabled ] || fail "the package enables the service"
# Ready, and so started, only with a completed cycle.
systemctl enable --now $unit || fail "it does not start"
pid=$(value MainPID)
[ "$(stat -c %U:%G /proc/"$pid")" = leadline:leadline ] || fail "it does not run as leadline"
for group in dialout gpio; do
  grep -q "^Groups:.*\b$(getent group $group | cut -d: -f3)\b" /proc/"$pid"/status || fail "it is not in group $group"
done
grep -q '^CapEff:	0*$' /proc/"$pid"/status || fail "it has capabilities"
grep -q '^NoNewPrivs:	1$' /proc/"$pid"/status && grep -q '^Seccomp:	2$' /proc/"$pid"/status || fail "it is not hardened"
journalctl --no-pager -o cat -u $unit | grep 'memory .*sched\|memory .*SCHED' || fail "it does not say whether memory is locked"
sleep 3
[ "$(value ActiveState)" = active ] || fail "it does not stay"

kill -KILL "$pid"
wait_for 30 restarted 1 || fail "killed, it does not begin again"
echo "killed: began again"
kill -STOP "$(value MainPID)"
wait_for 90 restarted 2 || fail "standing still, it is not started again"
journalctl --no-pager -o cat -u $unit | grep -q 'Watchdog timeout' || fail "it was not the watchdog"
echo "stood still: the watchdog began it again"

pid=$(value MainPID)
DEBIAN_FRONTEND=noninteractive dpkg -i --force-confdef --force-confold /opt/next.deb || fail "it cannot be upgraded"
wait_for 30 restarted 0 && [ "$(value MainPID)" != "$pid" ] || fail "after the upgrade the old version runs on"
systemctl stop $unit || fail "it does not stop"
[ "$(value Result)" = success ] || fail "it does not stop in order: $(value Result)"
ls -l /var/lib/leadline
# Killed twice: their logs end where they were cut. Ended by the upgrade and by hand: in order.
replays=$(leadline-replay /var/lib/leadline/*.lll)
echo "$replays"
[ "$(echo "$replays" | grep -c same_as_flight=true)" -eq 2 ] || fail "not two logs have their end"
[ "$(echo "$replays" | grep -c same_as_flight=unknown)" -eq 2 ] || fail "not two logs are cut"

echo 'colour = "red"' >>vehicle.toml
! systemctl start $unit 2>/dev/null || fail "it starts with a wrong configuration"
sleep 4
[ "$(value NRestarts)" -eq 0 ] && [ "$(value ExecMainStatus)" -eq 2 ] || fail "a wrong configuration is tried again"
sed -i '$d' vehicle.toml
systemctl reset-failed $unit
systemctl start $unit || fail "it does not start again"
DEBIAN_FRONTEND=noninteractive dpkg -r leadline-vehicle || fail "it cannot be removed"
! systemctl is-active -q $unit || fail "removed, it runs on"
[ ! -e /etc/systemd/system/multi-user.target.wants/$unit ] || fail "removed, it is still enabled"
echo held
systemctl poweroff --no-block
