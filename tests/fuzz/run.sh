#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: run.sh [--anew] <program> <seeds> <work directory> [libFuzzer arguments]
# Fuzzes from the target's folder among the seeds, if it has one, and from what earlier runs left in the work directory's
# corpus; with --anew, that is thrown away first. Inputs that fail are written to the work directory's findings, and the exit
# status is not 0.
set -eu
anew=
if [ "$1" = --anew ]; then
  anew=yes
  shift
fi
program=$1 seeds=$2 work=$3
shift 3
target=$(basename "$program")
if [ ! -d "$seeds" ]; then
  echo "run.sh: no seeds in $seeds; the target fuzz_seeds of the preset release makes them" >&2
  exit 1
fi
[ -z "$anew" ] || rm -rf "$work/corpus"
mkdir -p "$work/corpus" "$work/findings" "$seeds/$target"
longest=2048
seconds=10
case $target in
  spirv_fuzz) longest=65536 ;;
  gltf_fuzz | inspect_fuzz) longest=131072 seconds=25 ;; # small files that need much work
esac
UBSAN_OPTIONS=print_stacktrace=1 \
  exec "$program" -artifact_prefix="$work/findings/" -timeout=$seconds -report_slow_units=$seconds -rss_limit_mb=2048 -malloc_limit_mb=1024 \
  -max_len=$longest -len_control=0 "$@" "$work/corpus" "$seeds/$target"
