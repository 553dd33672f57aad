// What has to be undone where a later step fails.
#pragma once

#include <utility>

namespace vellum::layer
{

// Runs a function at the end of the scope, however it is left, unless everything succeeded: keep(). Every command that
// goes on after the driver has made an object destroys the object by one, since allocations of its own may throw.
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
