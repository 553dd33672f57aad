// SPDX-License-Identifier: Apache-2.0
// The fuzzer's mutations of SPIR-V modules. They mostly keep instructions whole, since a module that falls apart into
// words tests little more than the parser.
#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
#include "spirv_input.h"

extern "C" size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t maxSize);

namespace vellum::fuzz
{
namespace
{

using Words = std::vector<uint32_t>;

// Instructions that the rewriter knows, of a few words of any value.
constexpr uint32_t kOpcodes[] = {
    spv::OpPhi,
    spv::OpLoopMerge,
    spv::OpSelectionMerge,
    spv::OpBranch,
    spv::OpBranchConditional,
    spv::OpSwitch,
    spv::OpReturn,
    spv::OpUnreachable,
    spv::OpLabel,
    spv::OpFunction,
    spv::OpFunctionEnd,
    spv::OpFunctionCall,
    spv::OpFunctionParameter,
    spv::OpVariable,
    spv::OpLoad,
    spv::OpStore,
    spv::OpCopyMemory,
    spv::OpCopyObject,
    spv::OpAccessChain,
    spv::OpInBoundsAccessChain,
    spv::OpExtInst,
    spv::OpNop,
    spv::OpUndef,
    spv::OpSelect,
    spv::OpBitwiseAnd,
    spv::OpTypeInt,
    spv::OpTypeFloat,
    spv::OpTypeStruct,
    spv::OpTypeArray,
    spv::OpTypeVector,
    spv::OpTypePointer,
    spv::OpConstant,
    spv::OpConstantNull,
    spv::OpSpecConstant,
    spv::OpSpecConstantOp,
    spv::OpCapability,
    spv::OpExtension,
    spv::OpEntryPoint,
    spv::OpExecutionMode,
    spv::OpExecutionModeId,
    spv::OpDecorate,
    spv::OpMemoryModel,
    spv::OpName,
    spv::OpRayQueryInitializeKHR,
    spv::OpRayQueryProceedKHR,
    spv::OpRayQueryGetRayFlagsKHR,
    spv::OpRayQueryGetIntersectionTypeKHR,
    spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR,
    spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR,
    spv::OpRayQueryConfirmIntersectionKHR,
    spv::OpTraceRayKHR,
    spv::OpIgnoreIntersectionKHR,
    spv::OpTraceRayMotionNV,
    spv::OpHitObjectTraceRayNV,
    spv::OpHitObjectTraceRayMotionNV,
    spv::OpHitObjectTraceRayEXT,
    spv::OpHitObjectTraceRayMotionEXT,
    spv::OpHitObjectTraceReorderExecuteEXT,
    spv::OpHitObjectTraceMotionReorderExecuteEXT,
    spv::OpHitObjectRecordFromQueryEXT,
    spv::OpHitObjectRecordMissEXT,
    spv::OpHitObjectExecuteShaderEXT,
    spv::OpHitObjectGetInstanceCustomIndexNV,
    spv::OpHitObjectGetInstanceCustomIndexEXT,
    spv::OpHitObjectGetRayFlagsEXT,
};

// Literals that mean something to the rewriter: capabilities, execution models and modes, built-ins, ray flags.
constexpr uint32_t kLiterals[] = {
    spv::CapabilityRayQueryKHR,
    spv::CapabilityRayTracingKHR,
    spv::CapabilityRayTraversalPrimitiveCullingKHR,
    spv::CapabilityRayQueryPositionFetchKHR,
    spv::CapabilityRayTracingOpacityMicromapKHR,
    spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR,
    spv::ExecutionModeOpacityMicromapIdKHR,
    spv::ExecutionModelRayGenerationKHR,
    spv::ExecutionModelIntersectionKHR,
    spv::ExecutionModelAnyHitKHR,
    spv::BuiltInInstanceCustomIndexKHR,
    spv::BuiltInIncomingRayFlagsKHR,
    spv::BuiltInRayGeometryIndexKHR,
    spv::BuiltInPrimitiveId,
    spv::DecorationBuiltIn,
    spv::AddressingModelPhysicalStorageBuffer64,
    spv::StorageClassHitAttributeKHR,
    0,
    1,
    2,
    3,
    0x80,
    0x400,
    0x481,
    32,
    64,
    0x7fffffff,
    0x80000000,
    0xffffffff,
};

class Mutation
{
public:
    Mutation(Words words, unsigned seed, size_t maxWords) : words_(std::move(words)), maxWords_(maxWords), random_(seed)
    {
        for (size_t at = kHeaderWords; at < words_.size();) {
            const size_t count = std::min<size_t>(words_[at] >> 16, words_.size() - at);
            if (count == 0)
                break;
            code_.emplace_back(words_.begin() + static_cast<ptrdiff_t>(at),
                               words_.begin() + static_cast<ptrdiff_t>(at + count));
            at += count;
        }
        bound_ = words_[3];
    }

    [[nodiscard]] bool empty() const { return code_.empty(); }

    Words mutate()
    {
        const uint32_t changes = 1 + (below(2) == 0 ? 0 : below(6));
        for (uint32_t i = 0; i < changes && !code_.empty(); ++i)
            change();
        return assemble();
    }

    // Inserts some instructions of another module, with result ids of their own.
    Words splice(const Mutation &other)
    {
        const size_t begin = below(other.code_.size());
        const size_t end = std::min(other.code_.size(), begin + 1 + below(16));
        size_t at = position();
        for (size_t i = begin; i < end; ++i)
            insert(at++, other.code_[i]);
        return assemble();
    }

private:
    uint32_t below(size_t n) { return static_cast<uint32_t>(random_() % n); }
    size_t any() { return below(code_.size()); }
    // Half of the time, an instruction that the rewriter handles.
    size_t position()
    {
        for (int i = 0; below(2) == 0 && i < 20; ++i) {
            const size_t at = any();
            const uint32_t opcode = code_[at][0] & 0xffff;
            if (std::find(std::begin(kOpcodes), std::end(kOpcodes), opcode) != std::end(kOpcodes))
                return at;
        }
        return any();
    }
    // An id that is there, or a literal, or anything.
    uint32_t value()
    {
        switch (below(8)) {
        case 0: return kLiterals[below(std::size(kLiterals))];
        case 1: return static_cast<uint32_t>(random_());
        case 2:
        case 3: {
            const Words &in = code_[any()];
            return in.size() > 1 ? in[1 + below(in.size() - 1)] : 0;
        }
        default: return below(std::max<uint32_t>(bound_, 1));
        }
    }

    static size_t resultWord(const Words &in)
    {
        const auto [hasResult, hasType] = spirv::resultShape(in[0] & 0xffff);
        const size_t word = hasType ? 2 : 1;
        return hasResult && word < in.size() ? word : 0;
    }

    void insert(size_t at, Words in)
    {
        if (const size_t word = resultWord(in); word != 0 && below(8) != 0)
            in[word] = bound_++;
        code_.insert(code_.begin() + static_cast<ptrdiff_t>(at), std::move(in));
    }

    void setCount(Words &in) { in[0] = static_cast<uint32_t>(in.size()) << 16 | (in[0] & 0xffff); }

    void change()
    {
        const size_t at = position();
        Words &in = code_[at];
        switch (below(16)) {
        case 0: code_.erase(code_.begin() + static_cast<ptrdiff_t>(at)); break;
        case 1: insert(below(2) == 0 ? at : position(), in); break;
        case 2: std::swap(in, code_[below(2) == 0 ? std::min(at + 1, code_.size() - 1) : any()]); break;
        case 3: duplicateRange(at); break;
        case 4: { // all that names one id now names another
            const uint32_t from = value(), to = value();
            for (Words &each : code_)
                for (size_t i = 1; i < each.size(); ++i)
                    if (i != resultWord(each) && each[i] == from)
                        each[i] = to;
            break;
        }
        case 5: // another instruction with the same operands
            in[0] = (in[0] & 0xffff0000) | kOpcodes[below(std::size(kOpcodes))];
            break;
        case 6: { // a new one
            Words fresh(1 + below(8));
            fresh[0] = kOpcodes[below(std::size(kOpcodes))];
            for (size_t i = 1; i < fresh.size(); ++i)
                fresh[i] = value();
            setCount(fresh);
            insert(at, std::move(fresh));
            break;
        }
        case 7: // fewer operands
            in.resize(1 + below(in.size()));
            setCount(in);
            break;
        case 8: // more
            for (uint32_t n = below(16) == 0 ? below(2000) : 1 + below(4); n > 0; --n)
                in.insert(in.begin() + 1 + static_cast<ptrdiff_t>(below(in.size())), value());
            setCount(in);
            break;
        case 9: broken(in); break;
        case 10: options_ = below(kAllOptions + 1); break;
        default: // an operand
            if (in.size() > 1) {
                uint32_t &operand = in[1 + below(in.size() - 1)];
                const size_t own = resultWord(in);
                if (own != 0 && below(8) == 0)
                    operand = in[own]; // of itself
                else
                    operand = below(8) == 0 ? operand ^ 1u << below(32) : value();
            }
            break;
        }
    }

    void duplicateRange(size_t at)
    {
        const size_t end = std::min(code_.size(), at + 1 + below(24));
        std::vector<Words> range(code_.begin() + static_cast<ptrdiff_t>(at),
                                 code_.begin() + static_cast<ptrdiff_t>(end));
        // Gives the copied range result ids of its own, as in valid code.
        for (Words &each : range) {
            const size_t word = resultWord(each);
            if (word == 0)
                continue;
            const uint32_t old = each[word], fresh = bound_++;
            for (Words &user : range)
                for (size_t i = 1; i < user.size(); ++i)
                    if (user[i] == old)
                        user[i] = fresh;
        }
        const size_t to = below(2) == 0 ? end : position();
        code_.insert(code_.begin() + static_cast<ptrdiff_t>(to), range.begin(), range.end());
    }

    // Makes the module invalid: an instruction with another length, an early end, or another header.
    void broken(Words &in)
    {
        switch (below(6)) {
        case 0: in[0] += below(2) == 0 ? 0x10000 : 0xffff0000; break;
        case 1: in[0] = (in[0] & 0xffff) | below(0x10000) << 16; break;
        case 2: cut_ = below(words_.size()); break;
        case 3: bound_ = value(); break;
        case 4: words_[1] = 0x10000 | below(8) << 8; break;
        default: words_[below(kHeaderWords)] = value(); break;
        }
    }

    Words assemble()
    {
        Words out(words_.begin(), words_.begin() + kHeaderWords);
        out[3] = bound_;
        if (options_ <= kAllOptions)
            out[kOptionsWord] = options_;
        for (const Words &in : code_)
            out.insert(out.end(), in.begin(), in.end());
        out.resize(std::min({out.size(), maxWords_, cut_}));
        return out;
    }

    Words words_;
    size_t maxWords_;
    std::minstd_rand random_;
    std::vector<Words> code_;
    uint32_t bound_ = 0;
    uint32_t options_ = UINT32_MAX;
    size_t cut_ = SIZE_MAX;
};

Words wordsOf(const uint8_t *data, size_t size)
{
    Words words(size / 4);
    if (!words.empty())
        std::memcpy(words.data(), data, words.size() * 4);
    return words;
}

size_t write(const Words &words, uint8_t *out)
{
    if (!words.empty())
        std::memcpy(out, words.data(), words.size() * 4);
    return words.size() * 4;
}

} // namespace
} // namespace vellum::fuzz

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t maxSize, unsigned seed)
{
    using namespace vellum::fuzz;
    Words words = wordsOf(data, size);
    if (words.size() <= kHeaderWords || seed % 32 == 0)
        return LLVMFuzzerMutate(data, size, maxSize);
    Mutation mutation(std::move(words), seed, maxSize / 4);
    return mutation.empty() ? LLVMFuzzerMutate(data, size, maxSize) : write(mutation.mutate(), data);
}

extern "C" size_t LLVMFuzzerCustomCrossOver(const uint8_t *data1, size_t size1, const uint8_t *data2, size_t size2,
                                            uint8_t *out, size_t maxOutSize, unsigned seed)
{
    using namespace vellum::fuzz;
    Words first = wordsOf(data1, size1);
    Words second = wordsOf(data2, size2);
    if (first.size() <= kHeaderWords || second.size() <= kHeaderWords)
        return 0;
    Mutation into(std::move(first), seed, maxOutSize / 4);
    const Mutation from(std::move(second), seed, maxOutSize / 4);
    return into.empty() || from.empty() ? 0 : write(into.splice(from), out);
}
