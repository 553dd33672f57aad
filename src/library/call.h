// SPDX-License-Identifier: Apache-2.0
// The frame of all functions of the library: exceptions become results, and callbacks are the baker's.
#pragma once

#include <atomic>
#include <new>
#include <stdexcept>
#include <utility>

#include "bake/bake.h"
#include "library/structures.h"
#include "vellum/vellum.h"

namespace vellum::library
{

// Runs a function of the library, and turns its exceptions into a result.
template <typename Function>
VellumResult guarded(VellumMessageCallback message, void *userData, Function &&function) noexcept
{
    const auto fail = [&](VellumResult result, const char *why) {
        if (message != nullptr)
            message(userData, result, why);
        return result;
    };
    try {
        function();
        return VELLUM_SUCCESS;
    } catch (const BakeCancelled &) {
        return VELLUM_CANCELLED;
    } catch (const Failure &failure) {
        return fail(failure.result(), failure.what());
    } catch (const BakeTooLarge &error) {
        return fail(VELLUM_ERROR_TOO_LARGE, error.what());
    } catch (const BakeError &error) {
        return fail(VELLUM_ERROR_INVALID_ARGUMENT, error.what());
    } catch (const std::bad_alloc &) {
        return fail(VELLUM_ERROR_OUT_OF_MEMORY, "out of memory");
    } catch (const std::length_error &) {
        return fail(VELLUM_ERROR_OUT_OF_MEMORY, "more memory is needed than there can be");
    } catch (const std::exception &error) {
        return fail(VELLUM_ERROR_INTERNAL, error.what());
    } catch (...) {
        return fail(VELLUM_ERROR_INTERNAL, "unknown exception");
    }
}

template <typename Function>
VellumResult guarded(Function &&function) noexcept
{
    return guarded(nullptr, nullptr, std::forward<Function>(function));
}

// The callbacks of a bake, which must end before they do.
class Callbacks
{
public:
    Callbacks(const VellumBakeOptions &given, BakeOptions &options) : given_(given)
    {
        if (given.progress != nullptr)
            options.progress = [this](size_t done, size_t total) {
                if (given_.progress(given_.userData, done, total) != 0)
                    stopped_ = true;
            };
        if (given.progress != nullptr || given.cancelled != nullptr)
            options.cancelled = [this] {
                return stopped_ || (given_.cancelled != nullptr && given_.cancelled(given_.userData) != 0);
            };
    }
    Callbacks(const Callbacks &) = delete;
    Callbacks &operator=(const Callbacks &) = delete;

    // Returns whether `progress` ended the bake, even at its last triangle.
    [[nodiscard]] bool stopped() const { return stopped_; }

private:
    const VellumBakeOptions &given_;
    std::atomic<bool> stopped_{false};
};

// Options of any version: the part that is known here, or the defaults for null. The callback for errors is one of the
// options that can be wrong, so readOptionsOf() comes before guarded() with a callback.
template <typename T>
VellumResult readOptionsOf(const T *given, T &known) noexcept
{
    return guarded([&] { known = given != nullptr ? knownPart(given) : Structure<T>::defaults(); });
}

} // namespace vellum::library
