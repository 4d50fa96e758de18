# Starts a Linux that is itself a plain process, with this machine's own tree as its read-only root. Sourced by tests.
# shellcheck shell=bash

guest_work=$(mktemp -d)  # what the test leaves there for the guest goes with it
guest_log=$guest_work/log
trap 'rm -rf "$guest_work"' EXIT

skip() {
  echo "*skipped*: $*"
  exit 77
}

# run_guest KERNEL INIT [NAME=VALUE...]: the script INIT of tests/cli/support is the guest's first process; it says GUEST-STARTED
# first and GUEST-RC=<exit code> at its end. What it says is printed, and left in $guest_log.
run_guest() {
  local kernel=$1 init=$LEADLINE_ROOT/tests/cli/support/$2 status=0
  shift 2
  # UML writes its state under TMPDIR and HOME.
  HOME=$guest_work TMPDIR=$guest_work timeout 300 "$kernel" mem=256M rootfstype=hostfs rootflags=/ ro "init=$init" \
    "$@" quiet con=null con0=fd:0,fd:1 </dev/null >"$guest_work/console" 2>&1 || status=$?
  tr -d '\r' <"$guest_work/console" >"$guest_log"
  cat "$guest_log"
  grep -q '^GUEST-STARTED' "$guest_log" || skip "this machine does not let a user-mode kernel start (exit $status)"
  grep -q '^GUEST-RC=' "$guest_log" || { echo "the guest did not get to its end (exit $status)"; exit 1; }
}
