// SPDX-License-Identifier: Apache-2.0
// Preloaded into a program: the process stops itself before one of the calls that change files, which whoever waits for
// it sees (WUNTRACED). VELLUM_STOPPED_CALL is the number of that call, from 0; -1 for none. VELLUM_WRITE_ERROR is the
// error of every write of more than 1 KiB, or VELLUM_WRITE_MOST bytes, to a file, VELLUM_ACCESS_ERROR that of every
// question whether a folder can be written, VELLUM_REMOVE_ERROR that of every file that is to be removed.
// VELLUM_SYNC_ERROR is that of every fsync() of a file system on which no file is without a name. VELLUM_FREE_BYTES is
// what is free in every file system. What a program prints does not count: the C library does not call its own write()
// by this name, and what write() gets must be a file.
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

namespace
{

void stopAtCall()
{
    static const char *const number = std::getenv("VELLUM_STOPPED_CALL");
    static int left = number != nullptr ? std::atoi(number) : 0;
    if (left-- == 0)
        raise(SIGSTOP);
}

// Sets errno to the value of a variable. Returns false if there is none.
bool failsBy(const char *variable)
{
    const char *const error = std::getenv(variable);
    if (error != nullptr)
        errno = std::atoi(error);
    return error != nullptr;
}

template <typename Function>
Function *next(Function *, const char *name)
{
    return reinterpret_cast<Function *>(dlsym(RTLD_NEXT, name));
}

} // namespace

#pragma GCC visibility push(default)
extern "C" {

ssize_t write(int file, const void *bytes, size_t count)
{
    struct stat status {
    };
    if (fstat(file, &status) == 0 && S_ISREG(status.st_mode)) {
        stopAtCall();
        const char *const most = std::getenv("VELLUM_WRITE_MOST");
        if (count > (most != nullptr ? std::strtoul(most, nullptr, 10) : 1024) && failsBy("VELLUM_WRITE_ERROR"))
            return -1;
    }
    return next(write, "write")(file, bytes, count);
}

int access(const char *path, int mode)
{
    if ((mode & W_OK) != 0 && failsBy("VELLUM_ACCESS_ERROR"))
        return -1;
    return next(access, "access")(path, mode);
}

int remove(const char *path)
{
    return failsBy("VELLUM_REMOVE_ERROR") ? -1 : next(remove, "remove")(path);
}

int open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
    va_end(arguments);
    if ((flags & O_TMPFILE) == O_TMPFILE && std::getenv("VELLUM_SYNC_ERROR") != nullptr) {
        errno = EOPNOTSUPP;
        return -1;
    }
    return next(open, "open")(path, flags, mode);
}

int fsync(int file)
{
    return failsBy("VELLUM_SYNC_ERROR") ? -1 : next(fsync, "fsync")(file);
}

int statvfs(const char *path, struct statvfs *facts)
{
    const int result = next(statvfs, "statvfs")(path, facts);
    const char *const bytes = std::getenv("VELLUM_FREE_BYTES");
    if (bytes != nullptr)
        facts->f_bavail = std::strtoul(bytes, nullptr, 10) / facts->f_frsize;
    return result;
}

int linkat(int fromFolder, const char *from, int toFolder, const char *to, int flags)
{
    stopAtCall();
    return next(linkat, "linkat")(fromFolder, from, toFolder, to, flags);
}

int rename(const char *from, const char *to)
{
    stopAtCall();
    return next(rename, "rename")(from, to);
}
}
#pragma GCC visibility pop
