#include "layer/memory/kept_addresses.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <utility>

#include <unistd.h>

#include "core/hash.h"

namespace vellum::layer
{
namespace
{

// Of all devices of this process. Never destroyed: a device that the application leaves behind may outlive it.
struct Places {
    std::mutex mutex;
    std::set<std::pair<std::string, int>> taken;
};

Places &locations()
{
    static auto &all = *new Places;
    return all;
}

int enterLocation(const std::string &stem)
{
    std::lock_guard lock(locations().mutex);
    int location = 0;
    while (!locations().taken.emplace(stem, location).second)
        ++location;
    return location;
}

} // namespace

KeptAddresses::~KeptAddresses()
{
    if (!isOpen())
        return;
    std::lock_guard lock(locations().mutex);
    locations().taken.erase({stem_, location_});
}

void KeptAddresses::open(const std::string &stem, const std::array<uint64_t, kTables> &tableBytes)
{
    stem_ = stem;
    tableBytes_ = tableBytes;
    location_ = enterLocation(stem);
    read();
}

std::string KeptAddresses::path() const
{
    return stem_ + "-" + std::to_string(location_) + ".addresses";
}

// A driver may trust what it is given.
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
    std::ifstream file(path());
    file >> std::hex;
    for (ReplayAddress &address : addresses_)
        file >> address.buffer >> address.memory;
    uint64_t sum = 0;
    // Tables of another size are not what lay there.
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
    std::filesystem::create_directories(std::filesystem::path(stem_).parent_path(), ignored);
    // Whole, or not at all: other processes may be reading it, or writing theirs.
    const std::string unfinished = path() + "." + std::to_string(getpid());
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
    std::filesystem::rename(unfinished, path(), ignored);
}

} // namespace vellum::layer
