#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# check_exports.sh LIBRARY [sanitized]: the layer exports the loader's entry points and nothing else, and depends on the C
# and C++ run-time libraries only. It has no thread_local objects with destructors, which mingw-w64 destroys after it has
# freed them.
set -euo pipefail
library=$1
exports=$(nm --dynamic --defined-only --format=posix "$library" | awk '{ print $1 }')
bad=$(grep -vxE 'vkNegotiateLoaderLayerInterfaceVersion|vkGetInstanceProcAddr|vkGetDeviceProcAddr' <<<"$exports" || true)
if [ -n "$bad" ]; then
    printf 'exported, but no business of the loader:\n%s\n' "$bad"
    exit 1
fi
grep -qx vkNegotiateLoaderLayerInterfaceVersion <<<"$exports" || {
    echo "vkNegotiateLoaderLayerInterfaceVersion is not exported"
    exit 1
}
allowed='libc|libm|libgcc_s|libstdc\+\+|ld-linux-[a-z0-9_-]+'
if [ "${2:-}" = sanitized ]; then
    allowed="$allowed|libasan|libubsan"
fi
needed=$(readelf --dynamic --wide "$library" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p')
bad=$(grep -vE "^($allowed)\.so" <<<"$needed" || true)
if [ -n "$bad" ]; then
    printf 'depends on:\n%s\n' "$bad"
    exit 1
fi
if nm --dynamic --undefined-only "$library" | grep -q __cxa_thread_atexit; then
    echo "a thread_local object has a destructor"
    exit 1
fi
echo "exports: $exports"
