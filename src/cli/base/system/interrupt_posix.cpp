// SPDX-License-Identifier: Apache-2.0
#include "cli/base/system/interrupt.h"

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>

namespace vellum::cli
{
namespace
{

constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};

std::atomic<int> came{0};
static_assert(std::atomic<int>::is_always_lock_free);

void remember(int signal)
{
    came = signal;
}

void handle(int signal, void (*handler)(int), int flags)
{
    struct sigaction action {
    };
    action.sa_handler = handler;
    action.sa_flags = flags;
    sigaction(signal, &action, nullptr);
}

} // namespace

Interruptible::Interruptible()
{
    came = 0;
    for (const int signal : kSignals) {
        struct sigaction before {
        };
        sigaction(signal, nullptr, &before);
        if (before.sa_handler != SIG_IGN) // nohup
            handle(signal, remember, static_cast<int>(SA_RESETHAND));
    }
    handle(SIGXFSZ, SIG_IGN, 0);
}

Interruptible::~Interruptible()
{
    for (const int signal : kSignals) {
        struct sigaction now {
        };
        sigaction(signal, nullptr, &now);
        if (now.sa_handler == remember)
            handle(signal, SIG_DFL, 0);
    }
    handle(SIGXFSZ, SIG_DFL, 0);
}

bool Interruptible::interrupted()
{
    return came != 0;
}

void Interruptible::die()
{
    handle(came, SIG_DFL, 0);
    std::raise(came);
    std::_Exit(128 + came);
}

} // namespace vellum::cli
