// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/reach.h"

#include <map>

#include "spirv/module/opcodes.h"

namespace vellum::spirv
{

std::set<Id> reachedFrom(const Module &module, std::vector<Id> functions)
{
    std::map<Id, std::set<Id>> callees;
    Id caller = 0;
    for (const Instruction in : module.section(Section::Functions)) {
        if (in.opcode == spv::OpFunction)
            caller = module.result(in);
        else if (in.opcode == spv::OpFunctionCall)
            callees[caller].insert(module.word(in, 3));
    }
    std::set<Id> reached;
    while (!functions.empty()) {
        const Id next = functions.back();
        functions.pop_back();
        if (!reached.insert(next).second)
            continue;
        const auto found = callees.find(next);
        if (found != callees.end())
            functions.insert(functions.end(), found->second.begin(), found->second.end());
    }
    return reached;
}

} // namespace vellum::spirv
