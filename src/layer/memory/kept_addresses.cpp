// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/kept_addresses.h"

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <mutex>
#include <set>
#include <unistd.h>
#include <utility>

#include "core/hash.h"
#include "core/utf8_path.h"
#include "layer/base/system.h"

namespace vellum::layer
{
namespace
{

#if defined(__SANITIZE_THREAD__) || UINTPTR_MAX == UINT32_MAX
constexpr uint64_t kAddresses = 0; // ThreadSanitizer has no shadow memory for the addresses below
#else
constexpr uint64_t kAddresses = 64;
#endif
// Far from the programs, heaps, libraries and stacks of Linux and Windows with 47 bits of address space or more.
constexpr uint64_t kFirst = 0x2f00'0000'0000;

} // namespace

FixedMemory::~FixedMemory()
{
    if (data_)
        unmapMemory(data_, bytes_);
}

bool FixedMemory::reserve(size_t bytes)
{
    if (data_ || bytes == 0 || bytes > kMostBytes)
        return false;
    for (uint64_t i = 0; i < kAddresses && !data_; ++i) {
        const auto address = static_cast<uintptr_t>(kFirst + i * kMostBytes);
        data_ = static_cast<std::byte *>(mapMemoryAt(reinterpret_cast<void *>(address), bytes));
    }
    bytes_ = data_ ? bytes : 0;
    return data_ != nullptr;
}

namespace
{

// The files in use by the devices of this process. Never destroyed, since a device may outlive static objects.
struct OpenFiles {
    std::mutex mutex;
    std::set<std::pair<std::string, int>> taken;
};

OpenFiles &openFiles()
{
    static auto &files = *new OpenFiles;
    return files;
}

int takeNumber(const std::string &stem)
{
    std::lock_guard lock(openFiles().mutex);
    int number = 0;
    while (!openFiles().taken.emplace(stem, number).second)
        ++number;
    return number;
}

} // namespace

KeptAddresses::~KeptAddresses()
{
    if (!isOpen())
        return;
    std::lock_guard lock(openFiles().mutex);
    openFiles().taken.erase({stem_, number_});
}

void KeptAddresses::open(const std::string &stem, const std::array<uint64_t, kTables> &tableBytes)
{
    stem_ = stem;
    tableBytes_ = tableBytes;
    number_ = takeNumber(stem);
    read();
}

std::string KeptAddresses::path() const
{
    return stem_ + "-" + std::to_string(number_) + ".addresses";
}

// A damaged file is not used: a driver may rely on the addresses it gets.
uint64_t KeptAddresses::checksum() const
{
    Hash sum;
    for (size_t i = 0; i < kTables; ++i) {
        for (const uint64_t value : {tableBytes_[i], addresses_[i].buffer, addresses_[i].memory}) {
            for (unsigned shift = 0; shift < 64; shift += 8)
                sum.add(value >> shift & 0xff);
        }
    }
    return sum.value();
}

void KeptAddresses::read()
{
    std::ifstream file(utf8Path(path()));
    file >> std::hex;
    for (ReplayAddress &address : addresses_)
        file >> address.buffer >> address.memory;
    uint64_t sum = 0;
    // The sum includes the sizes: tables of other sizes cannot have these addresses.
    if (!(file >> sum) || sum != checksum())
        addresses_ = {};
}

void KeptAddresses::set(size_t table, ReplayAddress address)
{
    changed_ = changed_ || addresses_[table] != address;
    addresses_[table] = address;
}

void KeptAddresses::write()
{
    if (!changed_)
        return;
    changed_ = false;
    std::error_code ignored;
    std::filesystem::create_directories(utf8Path(stem_).parent_path(), ignored);
    // The file appears whole: other processes may be reading it, or writing theirs.
    const std::filesystem::path unfinished = utf8Path(path() + "." + std::to_string(getpid()));
    {
        std::ofstream file(unfinished);
        file << std::hex;
        for (const ReplayAddress &address : addresses_)
            file << address.buffer << ' ' << address.memory << '\n';
        file << checksum() << '\n';
        if (!file.flush()) {
            std::filesystem::remove(unfinished, ignored);
            return;
        }
    }
    std::filesystem::rename(unfinished, utf8Path(path()), ignored);
}

} // namespace vellum::layer
