// SPDX-License-Identifier: Apache-2.0
// Operands of the instructions that trace rays of pipelines, or make and use hit objects.
#pragma once

#include <cstdint>
#include <optional>

namespace vellum::spirv
{

// Words of an instruction; 0: it has no such operand.
struct RayInstruction {
    uint32_t hitObject = 0;
    uint32_t flags = 0;   // of the ray, which may be one that is recorded as a miss
    uint32_t payload = 0; // of the shaders that it calls
    uint32_t query = 0;   // the ray query that the hit object is made from
    bool empties = false; // makes an empty hit object

    // It traces a ray, and may call shaders for it.
    [[nodiscard]] bool traces() const { return payload != 0 && flags != 0; }
    // The SBT stride of a traced ray, which follows flags, cull mask and SBT offset.
    [[nodiscard]] uint32_t stride() const { return traces() ? flags + 3 : 0; }
    // It calls shaders for a hit object that was made before.
    [[nodiscard]] bool onlyExecutes() const { return payload != 0 && flags == 0; }
};

// Nothing for instructions that neither trace a ray, nor make a hit object, nor call shaders for one.
std::optional<RayInstruction> rayInstruction(uint32_t opcode);

} // namespace vellum::spirv
