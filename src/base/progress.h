// SPDX-License-Identifier: Apache-2.0
// Shows on stderr what is being done, on a terminal; elsewhere only if lines are wanted.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>

namespace vellum
{

class ProgressLine
{
public:
    // Shows `what` on stderr, if that is a terminal and `enabled`.
    explicit ProgressLine(std::string what, bool enabled = true);
    // If stderr is not a terminal, also prints a line of plain text at this interval in seconds; 0: none.
    ProgressLine(std::string what, double secondsBetweenLines);
    // Clears the line.
    ~ProgressLine();
    ProgressLine(const ProgressLine &) = delete;
    ProgressLine &operator=(const ProgressLine &) = delete;

    void update(size_t done, size_t total);
    // `words` is called when the line is shown.
    void update(const std::function<std::string()> &words);

    // Shows none from now on.
    static void disable() { disabled_ = true; }

private:
    inline static bool disabled_ = false;
    std::string what_;
    bool enabled_;
    int shown_ = -1;   // percent
    double pause_ = 1; // seconds between words
    bool lines_ = false;
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

} // namespace vellum
