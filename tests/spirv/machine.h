// SPDX-License-Identifier: Apache-2.0
// Runs the assembly of the tests, to compare a module with its rewritten self: enough of SPIR-V for loops around one
// ray query, and for rays that ray generation shaders trace. The query's ray meets the candidates of a script.
#pragma once

#include "spirv/module/module.h"

#include <cstdint>
#include <map>

namespace vellum::test
{

// A candidate as it is resolved: the application sees it, or the rewritten module decides it.
struct Candidate {
    uint32_t name;
    bool decided;
};

class Machine
{
public:
    // specialization: values of specialization constants by SpecId.
    Machine(const std::vector<uint32_t> &words, std::vector<Candidate> script,
            const std::map<uint32_t, uint32_t> &specialization = {});

    // Added to the ray flags in what run() returns of an instruction that traces a ray, and of one that executes the
    // shaders of a hit object.
    static constexpr uint32_t kTraced = 0x10000, kExecuted = 0x20000;
    // Runs an entry point. What the application does that can be seen from outside: values stored to memory,
    // candidates confirmed, and the driver's flags of rays and hit objects. Ends with ~0 if the steps run out.
    std::vector<uint32_t> run(const std::string &entryPoint = "main");
    // Ray flags that the query was last initialized with.
    [[nodiscard]] uint32_t rayFlags() const { return rayFlags_; }

private:
    uint32_t call(spirv::Id function, const std::vector<uint32_t> &arguments);
    void branch(spirv::Id to);
    uint32_t evaluate(spirv::Instruction in);
    uint32_t evaluateRay(spirv::Instruction in);
    // The variable that a pointer, which may be a parameter, points to.
    spirv::Id variable(spirv::Id pointer) const;
    uint32_t value(spirv::Id id) const;
    uint32_t constant(spirv::Instruction in) const;

    spirv::Module module_;
    std::vector<Candidate> script_;
    size_t position_ = 0; // of the current candidate, counted from 1
    std::map<spirv::Id, uint32_t> values_;
    std::map<spirv::Id, uint32_t> variables_;
    std::map<spirv::Id, std::string> names_;
    std::map<spirv::Id, size_t> labels_, functions_;
    size_t at_ = 0;
    spirv::Id block_ = 0;
    int steps_ = 0;
    std::vector<uint32_t> seen_;
    std::map<spirv::Id, uint32_t> specialized_;
    uint32_t rayFlags_ = 0;
    std::map<spirv::Id, spirv::Id> arguments_;     // by pointer parameter
    std::map<spirv::Id, uint32_t> hitObjectFlags_; // flags that the driver knows, by variable
};

} // namespace vellum::test
