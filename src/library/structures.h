// SPDX-License-Identifier: Apache-2.0
// The structures of vellum/vellum.h in all their versions: today's form of what a caller of any other day gave.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

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

} // namespace vellum::library
