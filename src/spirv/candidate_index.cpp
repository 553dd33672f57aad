// SPDX-License-Identifier: Apache-2.0
#include "spirv/candidate_index.h"

#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"

namespace vellum::spirv
{
namespace
{

constexpr uint32_t kCandidateIntersection = 0; // RayQueryIntersection: the candidate, not the committed one

// The word of an instruction that holds its ray query; 0 if it has none.
uint32_t queryWord(Instruction in)
{
    switch (in.opcode) {
    case spv::OpRayQueryInitializeKHR:
    case spv::OpRayQueryTerminateKHR:
    case spv::OpRayQueryGenerateIntersectionKHR:
    case spv::OpRayQueryConfirmIntersectionKHR: return 1;
    case spv::OpRayQueryProceedKHR:
    case spv::OpRayQueryGetIntersectionTypeKHR:
    case spv::OpRayQueryGetRayTMinKHR:
    case spv::OpRayQueryGetRayFlagsKHR:
    case spv::OpRayQueryGetIntersectionTKHR:
    case spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR:
    case spv::OpRayQueryGetIntersectionInstanceIdKHR:
    case spv::OpRayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR:
    case spv::OpRayQueryGetIntersectionGeometryIndexKHR:
    case spv::OpRayQueryGetIntersectionPrimitiveIndexKHR:
    case spv::OpRayQueryGetIntersectionBarycentricsKHR:
    case spv::OpRayQueryGetIntersectionFrontFaceKHR:
    case spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR:
    case spv::OpRayQueryGetIntersectionObjectRayDirectionKHR:
    case spv::OpRayQueryGetIntersectionObjectRayOriginKHR:
    case spv::OpRayQueryGetWorldRayDirectionKHR:
    case spv::OpRayQueryGetWorldRayOriginKHR:
    case spv::OpRayQueryGetIntersectionObjectToWorldKHR:
    case spv::OpRayQueryGetIntersectionWorldToObjectKHR:
    case spv::OpRayQueryGetIntersectionTriangleVertexPositionsKHR: return 3;
    default: return 0;
    }
}

} // namespace

bool CandidateIndices::getsCandidate(Instruction in) const
{
    return in.opcode == spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR &&
           types_.valueOf(module_.word(in, 4)) == kCandidateIntersection;
}

// The variables that get a side variable.
std::set<Id> CandidateIndices::find() const
{
    std::set<Id> found, queried;
    for (const Section section : {Section::Globals, Section::Functions})
        for (const Instruction in : module_.section(section))
            if (in.opcode == spv::OpVariable) {
                const Id pointee = module_.word(module_.definition(module_.word(in, 1)), 3);
                if (module_.definition(pointee).opcode == spv::OpTypeRayQueryKHR)
                    found.insert(module_.result(in));
            }
    bool always = false;
    for (const Instruction in : module_.section(Section::Functions)) {
        if (found.empty())
            break;
        if (in.opcode == spv::OpFunction)
            always = consumption_.in(module_.result(in)).when == Consumes::When::Always;
        if (in.opcode == spv::OpVariable || isDebug(module_, in))
            continue;
        const uint32_t own = queryWord(in);
        if (own != 0 && getsCandidate(in))
            queried.insert(module_.word(in, own));
        // Any other use, even a literal of the same value, excludes the variable.
        for (uint32_t i = 1; i < in.count; ++i)
            if (i != own || !always)
                found.erase(module_.word(in, i));
    }
    std::erase_if(found, [&](Id variable) { return !queried.contains(variable); });
    return found;
}

bool CandidateIndices::declare()
{
    const std::set<Id> found = find();
    return found.empty() || beside_.declare(found);
}

Id CandidateIndices::of(Instruction in) const
{
    return getsCandidate(in) ? beside(module_.word(in, 3)).id : 0;
}

} // namespace vellum::spirv
