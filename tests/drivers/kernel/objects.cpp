// SPDX-License-Identifier: Apache-2.0
#include "objects.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace vellum::test::kernel
{

int Objects::create(u64 size, u32 &handle)
{
    constexpr u64 kMost = u64{1} << 46;
    std::lock_guard lock(mutex_);
    if (size == 0 || size > kMost || end_ > kMost)
        return EINVAL;
    const u64 whole = (size + kPageSize - 1) / kPageSize * kPageSize;
    if (ftruncate(file_, static_cast<off_t>(end_ + whole)) != 0)
        return ENOMEM;
    handle = ++last_;
    pieces_[handle] = {end_, whole};
    end_ += whole;
    return 0;
}

int Objects::offset(u32 handle, u64 &offset)
{
    std::lock_guard lock(mutex_);
    const auto found = pieces_.find(handle);
    if (found == pieces_.end())
        return ENOENT;
    offset = found->second.offset;
    return 0;
}

int Objects::close(u32 handle)
{
    std::lock_guard lock(mutex_);
    const auto found = pieces_.extract(handle);
    if (!found)
        return EINVAL;
    // Its offset is not reused, but it takes no memory any more.
    fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(found.mapped().offset),
              static_cast<off_t>(found.mapped().size));
    return 0;
}

u32 Objects::newHandle()
{
    std::lock_guard lock(mutex_);
    return ++last_;
}

} // namespace vellum::test::kernel
