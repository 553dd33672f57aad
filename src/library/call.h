// SPDX-License-Identifier: Apache-2.0
// Calls of the library: its structures in all their versions (today's form of what a caller of any other day gave),
// exceptions that become results, and callbacks of the baker.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bake/bake.h"
#include "bake/option_ranges.h"
#include "core/micromap.h"
#include "vellum/vellum.h"

namespace vellum::library
{

// The members of VellumBakeOptions for each of kBakeNumbers.
inline constexpr std::array kNumbers = {
    &VellumBakeOptions::texelsPerEdge,        &VellumBakeOptions::minKnown,
    &VellumBakeOptions::valueTolerance,       &VellumBakeOptions::subtexelTolerance,
    &VellumBakeOptions::barycentricTolerance, &VellumBakeOptions::interpolationTolerance,
};
static_assert(kNumbers.size() == kBakeNumbers.size());

// Ends a call of the library.
class Failure : public std::runtime_error
{
public:
    Failure(VellumResult result, const std::string &message) : std::runtime_error(message), result_(result) {}
    [[nodiscard]] VellumResult result() const { return result_; }

private:
    VellumResult result_;
};

inline Failure invalid(const std::string &message)
{
    return {VELLUM_ERROR_INVALID_ARGUMENT, message};
}

// Name, default and first version of a structure.
template <typename T>
struct Structure;
#define VELLUM_STRUCTURE(type, last)                                                                                   \
    template <>                                                                                                        \
    struct Structure<type> {                                                                                           \
        static constexpr const char *kName = #type;                                                                    \
        /* To where the last member of the first version ends. */                                                      \
        static constexpr size_t kFirstSize = offsetof(type, last) + sizeof(type::last);                                \
        static type defaults();                                                                                        \
    }
VELLUM_STRUCTURE(VellumTexture, border);
VELLUM_STRUCTURE(VellumBakeInput, cutoff);
VELLUM_STRUCTURE(VellumBakeOptions, userData);
VELLUM_STRUCTURE(VellumMicromapInfo, distinctCount);
VELLUM_STRUCTURE(VellumGeometryInfo, usageCount);

template <typename T>
size_t checkedSize(const T *structure)
{
    using Known = Structure<T>;
    if (structure == nullptr)
        throw invalid(std::string("there is no ") + Known::kName);
    const size_t size = structure->structSize;
    // Larger sizes are random: the caller did not initialize the structure.
    constexpr size_t kMost = 4096;
    if (size < Known::kFirstSize || size > kMost)
        throw invalid(std::string("structSize of ") + Known::kName + " is " + std::to_string(size) +
                      "; has it been initialized?");
    return size;
}

// The members that both sides know, and defaults for the others.
template <typename T>
T knownPart(const T *given)
{
    const size_t size = std::min(checkedSize(given), sizeof(T));
    T known = Structure<T>::defaults();
    std::memcpy(&known, given, size);
    known.structSize = sizeof(T);
    return known;
}

// Throws Failure where the caller uses members that this library does not know.
template <typename T>
void checkUnknownPart(const T *given)
{
    const auto *bytes = reinterpret_cast<const char *>(given);
    const size_t size = checkedSize(given);
    if (size > sizeof(T) && std::any_of(bytes + sizeof(T), bytes + size, [](char byte) { return byte != 0; }))
        throw Failure(VELLUM_ERROR_UNSUPPORTED,
                      std::string(Structure<T>::kName) + " uses members that this version of libvellum does not know");
}

// Implements vellumInit...(): sets the defaults; does nothing for a structure that cannot hold structSize.
template <typename T>
void initialize(T *structure, size_t structSize)
{
    if (structure == nullptr || structSize < sizeof structure->structSize)
        return;
    T values = Structure<T>::defaults();
    values.structSize = structSize;
    std::memset(static_cast<void *>(structure), 0, structSize);
    std::memcpy(static_cast<void *>(structure), &values, std::min(structSize, sizeof values));
}

// Fills the part of a structure that the caller knows, except structSize.
template <typename T>
void fill(T *given, T values)
{
    const size_t size = checkedSize(given);
    values.structSize = size;
    std::memset(given, 0, size);
    std::memcpy(given, &values, std::min(size, sizeof(T)));
}

static_assert(sizeof(VellumMicromapTriangle) == sizeof(MicromapTriangle));
// Both structures have the same layout, as their comments state.
inline const VellumMicromapTriangle *trianglesOf(std::span<const MicromapTriangle> triangles)
{
    return reinterpret_cast<const VellumMicromapTriangle *>(triangles.data());
}

static_assert(static_cast<uint32_t>(Format::TwoState) == VELLUM_MICROMAP_FORMAT_2_STATE &&
              static_cast<uint32_t>(Format::FourState) == VELLUM_MICROMAP_FORMAT_4_STATE);
// Usage counts as vellum.h has them.
inline std::vector<VellumMicromapUsage> libraryUsages(std::span<const MicromapUsage> usages)
{
    std::vector<VellumMicromapUsage> all;
    for (const MicromapUsage &usage : usages)
        all.push_back({usage.count, usage.subdivisionLevel, static_cast<uint32_t>(usage.format)});
    return all;
}

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

// Runs a function of the library that takes options of any version: the part that is known here, or the defaults for
// null. The callback for errors is one of the options that can be wrong, so it is called for what is wrong after them.
template <typename T, typename Function>
VellumResult guardedWith(const T *given, Function &&function) noexcept
{
    T known{};
    const VellumResult readable =
        guarded([&] { known = given != nullptr ? knownPart(given) : Structure<T>::defaults(); });
    if (readable != VELLUM_SUCCESS)
        return readable;
    return guarded(known.message, known.userData, [&] {
        if (given != nullptr)
            checkUnknownPart(given);
        function(known);
    });
}

} // namespace vellum::library
