// SPDX-License-Identifier: Apache-2.0
// What the static C++ library of the compiler needs of a newer C library than the archives are linked to.
#include <stdint.h>
#include <stdlib.h>
#include <unistd.h>

// glibc 2.32: false where there may be several threads, which always may.
char __libc_single_threaded = 0;

// glibc 2.36
uint32_t arc4random(void)
{
    uint32_t value;
    if (getentropy(&value, sizeof value) != 0)
        abort();
    return value;
}
