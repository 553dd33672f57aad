// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and the like, for commands that have something to clean up.
#pragma once

namespace vellum::cli
{

// While there is one, SIGINT, SIGTERM and SIGHUP are only remembered; the second of a kind ends the process as ever. A
// write to a file that may not grow further fails instead of ending the process (SIGXFSZ).
class Interruptible
{
public:
    Interruptible();
    ~Interruptible();
    Interruptible(const Interruptible &) = delete;
    Interruptible &operator=(const Interruptible &) = delete;

    // From any thread.
    static bool interrupted();
    // Ends the process by the signal that came, as whoever started it expects.
    [[noreturn]] static void die();
};

} // namespace vellum::cli
