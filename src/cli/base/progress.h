// SPDX-License-Identifier: Apache-2.0
// Shows on a terminal what is being done; silent elsewhere.
#pragma once

#include <cstddef>
#include <string>

namespace vellum::cli
{

class Progress
{
public:
    // Shows `what` on stderr, if that is a terminal and `enabled`.
    explicit Progress(std::string what, bool enabled = true);
    // Clears the line.
    ~Progress();
    Progress(const Progress &) = delete;
    Progress &operator=(const Progress &) = delete;

    void update(size_t done, size_t total);

    // Shows none from now on.
    static void disable() { disabled_ = true; }

private:
    inline static bool disabled_ = false;
    std::string what_;
    bool enabled_;
    int shown_ = -1; // percent
};

} // namespace vellum::cli
