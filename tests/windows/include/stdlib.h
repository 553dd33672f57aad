// SPDX-License-Identifier: Apache-2.0
// setenv() and unsetenv(), which tests use and Windows' C library lacks.
#include_next <stdlib.h>
#ifndef VELLUM_TESTS_STDLIB_H
#define VELLUM_TESTS_STDLIB_H

#ifdef __cplusplus
extern "C" {
#endif
int _putenv_s(const char *name, const char *value);
__declspec(dllimport) int __stdcall SetEnvironmentVariableA(const char *name, const char *value);
#ifdef __cplusplus
}
#endif

static inline int setenv(const char *name, const char *value, int overwrite)
{
    if (overwrite == 0 && getenv(name) != NULL)
        return 0;
    _putenv_s(name, value); // removes a variable without a value
    return SetEnvironmentVariableA(name, value) ? 0 : -1;
}

static inline int unsetenv(const char *name)
{
    return _putenv_s(name, "");
}

#endif
