// SPDX-License-Identifier: Apache-2.0
// The resources of this process that could grow.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace vt
{

struct Footprint {
    uint64_t resident = 0; // bytes
    uint64_t mappings = 0; // each allocation of device memory is one

    static Footprint now()
    {
        Footprint footprint;
        std::ifstream status("/proc/self/statm");
        uint64_t pages = 0;
        status >> pages >> footprint.resident;
        footprint.resident *= 4096;
        std::ifstream maps("/proc/self/maps");
        for (std::string line; std::getline(maps, line);)
            ++footprint.mappings;
        return footprint;
    }
};

// The address sanitizer keeps what is freed for a while.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kResidentIsMeaningful = false;
#else
inline constexpr bool kResidentIsMeaningful = true;
#endif

} // namespace vt
