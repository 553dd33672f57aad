// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace vt
{

// The setting assume_micromaps for the instances that are created while this exists.
class AssumedMicromaps
{
public:
    explicit AssumedMicromaps(bool assumed = true)
    {
        if (assumed)
            setenv(kVariable, "1", 1);
    }
    ~AssumedMicromaps() { unsetenv(kVariable); }
    AssumedMicromaps(const AssumedMicromaps &) = delete;
    AssumedMicromaps &operator=(const AssumedMicromaps &) = delete;

private:
    static constexpr const char *kVariable = "VELLUM_ASSUME_MICROMAPS";
};

} // namespace vt
