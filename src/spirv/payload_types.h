// What the payloads of rays are made of, as the shaders of a pipeline declare them. Where flags travel before the
// payload (payload_prefix.h), shaders that declare none get one, and all of a ray must be alike
// (VUID-RuntimeSpirv-OpTraceRayKHR-11855).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "spirv/module/types.h"

namespace vellum::spirv
{

// A type in words without ids: equal words, equal types. Empty: not known.
using TypeWords = std::vector<uint32_t>;

class PayloadTypes
{
public:
    // Adds the payloads that an entry point declares: the one that it is called with, and those of rays that it traces.
    // Of what is no SPIR-V, and of types that specialization may change, nothing is known. Returns the type of the
    // payload that the entry point is called with; nothing where it declares none.
    std::optional<TypeWords> add(std::span<const uint32_t> words, std::string_view entryPoint, uint32_t executionModel);
    void add(const PayloadTypes &other);

    // The type of all; empty where no payload was added, or where they differ or are not known.
    [[nodiscard]] TypeWords common() const;

private:
    void add(TypeWords type);

    std::optional<TypeWords> first_;
    bool differ_ = false;
};

// The variable with the payload that an entry point is called with; 0 where it declares none. Other entry points must
// still be there.
Id incomingPayload(const Module &module, Instruction entry);

// Such a type in a module. 0 where the words are not a type's.
Id makeType(Module &module, Types &types, std::span<const uint32_t> words);

} // namespace vellum::spirv
