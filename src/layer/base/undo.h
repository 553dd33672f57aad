// SPDX-License-Identifier: Apache-2.0
// An action that is undone if a later step fails.
#pragma once

#include <utility>

namespace vellum::layer
{

// Runs a function at the end of the scope, unless keep() was called because everything succeeded. A command that goes
// on after the driver has created an object destroys the object by an Undo, since its own allocations may throw.
template <typename Function>
class Undo
{
public:
    explicit Undo(Function function) : function_(std::move(function)) {}
    ~Undo()
    {
        if (!kept_)
            function_();
    }
    Undo(const Undo &) = delete;
    Undo &operator=(const Undo &) = delete;
    void keep() { kept_ = true; }

private:
    Function function_;
    bool kept_ = false;
};

} // namespace vellum::layer
