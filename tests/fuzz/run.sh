#!/bin/sh
# usage: run.sh [--anew] <build directory> <target> <work directory> [libFuzzer arguments]
# Fuzzes from the target's seeds and from what earlier runs left in the work directory's corpus; with --anew, that is
# thrown away first. Inputs that fail are written to the work directory's findings, and the exit status is not 0.
set -eu
anew=
if [ "$1" = --anew ]; then
  anew=yes
  shift
fi
build=$1 target=$2 work=$3
shift 3
[ -z "$anew" ] || rm -rf "$work/corpus"
mkdir -p "$work/corpus" "$work/findings" "$build/seeds/$target"
longest=2048
[ "$target" != spirv_fuzz ] || longest=65536
[ "$target" != gltf_fuzz ] || longest=8192
UBSAN_OPTIONS=print_stacktrace=1 \
  exec "$build/bin/$target" -artifact_prefix="$work/findings/" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=1024 \
  -max_len=$longest -len_control=0 "$@" "$work/corpus" "$build/seeds/$target"
