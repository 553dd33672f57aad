// SPDX-License-Identifier: Apache-2.0
// Payload types that the shaders of a pipeline declare. If flags travel before the payload (payload_prefix.h), shaders
// without a payload get one, and all shaders of a ray must declare the same (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "spirv/module/types.h"

namespace vellum::spirv
{

// A type in words without ids: types are equal if their words are. Empty: unknown.
using TypeWords = std::vector<uint32_t>;

class PayloadTypes
{
public:
    // Adds the payloads that an entry point declares: the incoming one, and those of rays that it traces. The types of
    // words that are not SPIR-V, and types that specialization may change, are unknown. Returns the type of the
    // incoming payload; nothing if it declares none.
    std::optional<TypeWords> add(std::span<const uint32_t> words, std::string_view entryPoint, uint32_t executionModel);
    void add(const PayloadTypes &other);

    // The common type; empty if no payload was added, or if they differ or are unknown.
    [[nodiscard]] TypeWords common() const;

private:
    void add(TypeWords type);

    std::optional<TypeWords> first_;
    bool differ_ = false;
};

// The incoming payload variable of an entry point; 0 if it declares none. Call before other entry points are removed.
Id incomingPayload(const Module &module, Instruction entry);

// Adds the type to a module. 0 if the words are not a type's.
Id makeType(Module &module, Types &types, std::span<const uint32_t> words);

} // namespace vellum::spirv
