// SPDX-License-Identifier: Apache-2.0
// Validation hands the input of a command that it has parsed and checked to the layer's implementation below, which is
// called as a driver is: with the application's arguments.
#pragma once

#include <utility>

#include <vulkan/vulkan.h>

namespace vellum::layer::input
{

// The input of a command, from its check by validation until the implementation has carried the command out in the same
// thread. It has no destructor that a thread_local object would need: objects are on the stack.
template <typename Input>
class Checked
{
public:
    // `arguments`: the address that identifies the command's arguments.
    Checked(const void *arguments, Input &input) : arguments_(arguments), input_(input) { current = this; }
    ~Checked() { current = outer_; }
    Checked(const Checked &) = delete;
    Checked &operator=(const Checked &) = delete;

    // The input with these arguments; `parse` parses and checks it, unless that was done before.
    template <typename Parse>
    static Input take(const void *arguments, Parse parse)
    {
        return current && current->arguments_ == arguments ? std::move(current->input_) : parse();
    }

private:
    inline static thread_local Checked *current = nullptr;
    const void *arguments_;
    Input &input_;
    Checked *outer_ = current;
};

// The check of the address ranges of a command, which is identified by its command buffer.
struct CheckedRanges {
    bool reported = false; // a violation
};
// Returns whether validation has reported a violation by the ranges of the command that is being recorded.
inline bool areRangesReported(VkCommandBuffer commandBuffer)
{
    return Checked<CheckedRanges>::take(commandBuffer, [] { return CheckedRanges{}; }).reported;
}

} // namespace vellum::layer::input
