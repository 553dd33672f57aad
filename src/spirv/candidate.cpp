// SPDX-License-Identifier: Apache-2.0
#include "spirv/candidate.h"

#include "core/opacity.h"
#include "spirv/module/code.h"
#include "spirv/module/numbers.h"

namespace vellum::spirv
{
namespace
{

constexpr uint32_t kCandidate = 0; // RayQueryIntersection: the candidate, not the committed one
constexpr uint32_t kCandidateTriangle = 0;
constexpr uint32_t kKeepsIndex = 2; // in a shape

std::vector<uint32_t> keyOf(const QueryAccess &access, const Consumes &consumes)
{
    std::vector<uint32_t> key{static_cast<uint32_t>(consumes.when), consumes.condition};
    key.insert(key.end(), access.shape.begin(), access.shape.end());
    return key;
}

} // namespace

std::optional<QueryAccess> CandidateFunctions::access(Id query) const
{
    const auto path = accessPath(module_, query);
    if (!path)
        return {};
    QueryAccess a;
    a.pointerType = module_.resultType(module_.definition(query));
    const Id base = module_.result(path->base);
    const SideVariables::Variable flags = queryFlags_.beside(base);
    if (queryFlags_.inUse() && flags.id == 0)
        return {};
    if (module_.isGlobal(base)) {
        a.base = base;
        a.flags = flags;
        a.index = indices_.beside(base);
        a.shape = {1, base};
    } else {
        const Id type = module_.resultType(path->base);
        a.shape = {0, type};
        a.arguments.push_back(base);
        a.parameterTypes.push_back(type);
        if (queryFlags_.inUse()) {
            a.flags.type = flags.type;
            a.arguments.push_back(flags.id);
            a.parameterTypes.push_back(flags.type);
        }
        a.index = indices_.beside(base);
        if (a.index.id != 0) {
            a.shape.push_back(kKeepsIndex);
            a.arguments.push_back(a.index.id);
            a.parameterTypes.push_back(a.index.type);
        }
    }
    for (const Id index : path->indices) {
        if (module_.isGlobal(index)) {
            a.indices.push_back(index);
            a.shape.insert(a.shape.end(), {1, index});
        } else {
            const Id type = module_.resultType(module_.definition(index));
            if (type == 0)
                return {};
            a.indices.push_back(0);
            a.shape.insert(a.shape.end(), {0, type});
            a.arguments.push_back(index);
            a.parameterTypes.push_back(type);
        }
    }
    return a;
}

Id CandidateFunctions::begin(const std::vector<Id> &parameterTypes, Id function, const char *name,
                             std::vector<Id> &parameters)
{
    std::vector<uint32_t> nameOperands = stringWords(name);
    nameOperands.insert(nameOperands.begin(), function);
    module_.append(Section::Names, spv::OpName, nameOperands);

    const Id boolean = types_.boolean();
    code_.put(spv::OpFunction,
              {boolean, function, spv::FunctionControlMaskNone, types_.function(boolean, parameterTypes)});
    for (const Id type : parameterTypes)
        parameters.push_back(code_.value(spv::OpFunctionParameter, type, {}));
    const Id label = module_.newId();
    code_.put(spv::OpLabel, {label});
    return label;
}

CandidateFunctions::Reached CandidateFunctions::reach(const QueryAccess &access, const std::vector<Id> &parameters)
{
    size_t next = 0;
    const Id base = access.base != 0 ? access.base : parameters[next++];
    SideVariables::Variable flags = access.flags;
    if (access.base == 0 && queryFlags_.inUse())
        flags.id = parameters[next++];
    Id index = access.index.id;
    if (access.base == 0 && index != 0)
        index = parameters[next++];
    std::vector<Id> indices;
    for (const Id i : access.indices)
        indices.push_back(i != 0 ? i : parameters[next++]);
    Reached reached{base, 0, index};
    if (queryFlags_.inUse())
        reached.flags = queryFlags_.element(flags, indices, types_.uint32(), code_);
    if (!indices.empty()) {
        indices.insert(indices.begin(), base);
        reached.query = code_.value(spv::OpAccessChain, access.pointerType, std::move(indices));
    }
    return reached;
}

Id CandidateFunctions::opacityFlags(Code &code, Reached reached)
{
    if (mode_.all)
        return types_.uintConstant(*mode_.all);
    const Id uint = types_.uint32();
    if (!mode_.hidden && queryFlags_.inUse())
        return code.value(spv::OpLoad, uint, {reached.flags});
    const Id flags = code.value(spv::OpRayQueryGetRayFlagsKHR, uint, {reached.query});
    const uint32_t hidden = mode_.hidden.value_or(0);
    return hidden == 0 ? flags : code.value(spv::OpBitwiseOr, uint, {flags, types_.uintConstant(hidden)});
}

Id CandidateFunctions::candidate(const QueryAccess &access, const Consumes &consumes)
{
    const Id decided = decide(access);
    if (!consumes.isConditional())
        return decided;
    Id &function = conditional_[keyOf(access, consumes)];
    if (function != 0)
        return function;
    function = module_.newId();

    const Id boolean = types_.boolean();
    const Id resolve = module_.newId(), end = module_.newId();
    std::vector<Id> parameters;
    const Id before = begin(access.parameterTypes, function, "vellumIfConsumed", parameters);
    const Id condition = consumption_.condition(consumes, code_);
    code_.put(spv::OpSelectionMerge, {end, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {condition, resolve, end});
    code_.put(spv::OpLabel, {resolve});
    parameters.insert(parameters.begin(), decided);
    const Id handled = code_.value(spv::OpFunctionCall, boolean, parameters);
    code_.put(spv::OpBranch, {end});
    code_.put(spv::OpLabel, {end});
    const Id none = types_.get(spv::OpConstantFalse, {boolean});
    code_.put(spv::OpReturnValue, {code_.value(spv::OpPhi, boolean, {handled, resolve, none, before})});
    code_.put(spv::OpFunctionEnd, {});
    return function;
}

Id CandidateFunctions::decide(const QueryAccess &access)
{
    Id &function = candidates_[access.shape];
    if (function != 0)
        return function;
    function = module_.newId();

    const Id boolean = types_.boolean();
    const Id uint = types_.uint32();
    const Id intersection = types_.uintConstant(kCandidate);
    const Id triangle = module_.newId(), confirm = module_.newId(), decided = module_.newId();
    const Id aabb = module_.newId(), end = module_.newId();

    std::vector<Id> parameters;
    begin(access.parameterTypes, function, "vellumCandidate", parameters);
    const Reached reached = reach(access, parameters);
    const Id query = reached.query;
    const auto get = [&](uint32_t opcode, Id type) { return code_.value(opcode, type, {query, intersection}); };

    const Id record = types_.get(spv::OpTypeVector, {uint, 4});
    const auto readInstance = [&] {
        const Id slot = get(spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR, uint);
        return code_.value(spv::OpFunctionCall, record, {linker_.function("vellumInstance"), slot});
    };

    Id instance = 0;
    if (reached.index != 0) { // of boxes, too
        instance = readInstance();
        code_.put(spv::OpStore, {reached.index, code_.value(spv::OpFunctionCall, uint,
                                                            {linker_.function("vellumIndexOf"), instance})});
    }
    const Id type = get(spv::OpRayQueryGetIntersectionTypeKHR, uint);
    const Id isTriangle = code_.value(spv::OpIEqual, boolean, {type, types_.uintConstant(kCandidateTriangle)});
    code_.put(spv::OpSelectionMerge, {end, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {isTriangle, triangle, aabb});

    code_.put(spv::OpLabel, {triangle});
    if (instance == 0)
        instance = readInstance();
    const Id geometry = get(spv::OpRayQueryGetIntersectionGeometryIndexKHR, uint);
    const Id primitive = get(spv::OpRayQueryGetIntersectionPrimitiveIndexKHR, uint);
    const Id uv = get(spv::OpRayQueryGetIntersectionBarycentricsKHR, types_.float32x2());
    const Id flags = opacityFlags(code_, reached);
    const Id hit = code_.value(spv::OpFunctionCall, uint,
                               {linker_.function("vellumResolve"), instance, geometry, primitive, uv, flags});
    const Id isOpaque = code_.value(spv::OpIEqual, boolean, {hit, types_.uintConstant(shared::kHitOpaque)});
    code_.put(spv::OpSelectionMerge, {decided, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {isOpaque, confirm, decided});
    code_.put(spv::OpLabel, {confirm});
    code_.put(spv::OpRayQueryConfirmIntersectionKHR, {query});
    code_.put(spv::OpBranch, {decided});
    code_.put(spv::OpLabel, {decided});
    const Id handled = code_.value(spv::OpINotEqual, boolean, {hit, types_.uintConstant(shared::kHitNonOpaque)});
    code_.put(spv::OpBranch, {end});

    // Boxes have no micromap. The driver knows which are opaque, but does not get the CullNoOpaque flag, so that those
    // that are not opaque are culled here.
    code_.put(spv::OpLabel, {aabb});
    Id dropped = types_.get(spv::OpConstantFalse, {boolean});
    if (!mode_.hidden || (*mode_.hidden & shared::kRayCullNoOpaque) != 0) {
        const Id opaque = code_.value(spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR, boolean, {query});
        const Id notOpaque = code_.value(spv::OpLogicalNot, boolean, {opaque});
        const Id cull = hasBits(types_, opacityFlags(code_, reached), shared::kRayCullNoOpaque, code_);
        dropped = code_.value(spv::OpLogicalAnd, boolean, {cull, notOpaque});
    }
    code_.put(spv::OpBranch, {end});

    code_.put(spv::OpLabel, {end});
    const Id result = code_.value(spv::OpPhi, boolean, {handled, decided, dropped, aabb});
    code_.put(spv::OpReturnValue, {result});
    code_.put(spv::OpFunctionEnd, {});
    return function;
}

Id CandidateFunctions::proceed(const QueryAccess &access, const Consumes &consumes)
{
    const std::vector<uint32_t> key = keyOf(access, consumes);
    if (const auto it = proceeds_.find(key); it != proceeds_.end())
        return it->second;
    const Id callee = candidate(access, consumes); // before this function begins, because it may append to code_
    const Id function = module_.newId();
    proceeds_[key] = function;

    const Id boolean = types_.boolean();
    const Id header = module_.newId(), check = module_.newId(), body = module_.newId();
    const Id next = module_.newId(), end = module_.newId();

    std::vector<Id> parameters;
    begin(access.parameterTypes, function, "vellumProceed", parameters);
    const Id query = reach(access, parameters).query;
    code_.put(spv::OpBranch, {header});
    code_.put(spv::OpLabel, {header});
    code_.put(spv::OpLoopMerge, {end, next, spv::LoopControlMaskNone});
    code_.put(spv::OpBranch, {check});
    code_.put(spv::OpLabel, {check});
    const Id found = code_.value(spv::OpRayQueryProceedKHR, boolean, {query});
    code_.put(spv::OpBranchConditional, {found, body, end});
    code_.put(spv::OpLabel, {body});
    parameters.insert(parameters.begin(), callee);
    const Id handled = code_.value(spv::OpFunctionCall, boolean, parameters);
    code_.put(spv::OpBranchConditional, {handled, next, end});
    code_.put(spv::OpLabel, {next});
    code_.put(spv::OpBranch, {header});
    code_.put(spv::OpLabel, {end}); // with `found` false from check, true from body
    code_.put(spv::OpReturnValue, {found});
    code_.put(spv::OpFunctionEnd, {});
    return function;
}

void CandidateFunctions::finish()
{
    auto &functions = module_.section(Section::Functions);
    functions.insert(functions.end(), code_.out.begin(), code_.out.end());
}

} // namespace vellum::spirv
