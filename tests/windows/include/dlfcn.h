// SPDX-License-Identifier: Apache-2.0
// The part of POSIX's dlfcn.h that tests use.
#pragma once

#include <windows.h>

#define RTLD_NOW 0
#define RTLD_LOCAL 0
#define RTLD_NOLOAD 1

inline void *dlopen(const char *file, int flags)
{
    return (flags & RTLD_NOLOAD) != 0 ? GetModuleHandleA(file) : LoadLibraryA(file);
}

inline void *dlsym(void *library, const char *name)
{
    return reinterpret_cast<void *>(GetProcAddress(static_cast<HMODULE>(library), name));
}

inline const char *dlerror()
{
    return "the library cannot be loaded";
}

inline int dlclose(void *library)
{
    return FreeLibrary(static_cast<HMODULE>(library)) != 0 ? 0 : -1;
}
