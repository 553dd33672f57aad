#include "spirv/candidate_index.h"

#include "spirv/module/opcodes.h"
#include "spirv/module/uses.h"

namespace vellum::spirv
{
namespace
{

constexpr std::uint32_t kCandidate = 0; // RayQueryIntersection: the candidate, not the committed one

// The word in which an instruction on ray queries has its query; 0: it is no such instruction.
std::uint32_t queryWord(Instruction in)
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
    case kOpRayQueryGetIntersectionTriangleVertexPositionsKHR: return 3;
    default: return 0;
    }
}

} // namespace

bool CandidateIndices::getsCandidate(Instruction in) const
{
    return in.opcode == spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR &&
           types_.valueOf(module_.word(in, 4)) == kCandidate;
}

// The variables that there is to be one beside.
std::set<Id> CandidateIndices::find() const
{
    std::set<Id> found, asked;
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
        const std::uint32_t own = queryWord(in);
        if (own != 0 && getsCandidate(in))
            asked.insert(module_.word(in, own));
        // Any other use, be it a literal of the same value, makes it a variable of which too little is known.
        for (std::uint32_t i = 1; i < in.count; ++i)
            if (i != own || !always)
                found.erase(module_.word(in, i));
    }
    std::erase_if(found, [&](Id variable) { return !asked.contains(variable); });
    return found;
}

CandidateIndices::Beside CandidateIndices::make(Instruction variable)
{
    const Id type = types_.get(spv::OpTypePointer, {module_.word(variable, 3), types_.uint32()});
    return beside_[module_.result(variable)] = {module_.newId(), type};
}

bool CandidateIndices::declare()
{
    const std::set<Id> found = find();
    if (found.empty())
        return true;
    const auto isOne = [&](Instruction in) {
        return in.opcode == spv::OpVariable && found.contains(module_.result(in));
    };
    std::vector<Id> globals;
    const std::vector<Instruction> declarations = module_.section(Section::Globals);
    for (const Instruction in : declarations) {
        if (!isOne(in))
            continue;
        const Beside made = make(in);
        module_.append(Section::Globals, spv::OpVariable, {made.type, made.id, module_.word(in, 3)});
        globals.push_back(made.id);
    }
    if (!module_.addToInterfaces(globals)) {
        error_ = kTooLongInterface;
        return false;
    }
    Code code(module_);
    const std::vector<Instruction> functions = module_.section(Section::Functions);
    for (const Instruction in : functions) {
        code.out.push_back(in);
        if (!isOne(in))
            continue;
        const Beside made = make(in);
        code.put(spv::OpVariable, {made.type, made.id, module_.word(in, 3)});
    }
    module_.section(Section::Functions) = std::move(code.out);
    return true;
}

CandidateIndices::Beside CandidateIndices::beside(Id variable) const
{
    const auto found = beside_.find(variable);
    return found == beside_.end() ? Beside{} : found->second;
}

Id CandidateIndices::of(Instruction in) const
{
    return getsCandidate(in) ? beside(module_.word(in, 3)).id : 0;
}

} // namespace vellum::spirv
