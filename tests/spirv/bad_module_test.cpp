// SPDX-License-Identifier: Apache-2.0
// Modules that are cut short or damaged: rejected or passed through, never a crash (the build with sanitizers checks
// that nothing is read out of bounds).
#include "support.h"

#include "spirv/module/micromap_mode.h"
#include "spirv/module/module.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace vellum::test
{
namespace
{

using Status = spirv::RewriteResult::Status;

const char *const kShaders[] = {"nested.comp", "array.comp", "parameter.comp", "flags.comp", "hit.rchit"};

std::vector<Module> modules()
{
    std::vector<Module> out;
    for (const char *shader : kShaders) {
        out.push_back(loadShader(shader, "debug"));
        out.push_back(loadShader(shader, "v15"));
        out.push_back(optimize(out.back()));
    }
    return out;
}

TEST(BadModules, CutShortAtEveryWord)
{
    for (const Module &words : modules())
        for (size_t n = 0; n < words.size(); ++n) {
            const std::span<const uint32_t> part(words.data(), n);
            const auto result = spirv::rewrite(part, {});
            ASSERT_EQ(result.status, spirv::scan(part).tracesRays ? Status::Failed : Status::Unchanged) << n;
            ASSERT_EQ(result.error.empty(), result.status != Status::Failed);
        }
}

// A small module whose decoration groups stand for gigabytes.
TEST(BadModules, HugeDecorationGroups)
{
    const Module original = loadShader("flags.comp", "v15");
    const uint32_t group = original[3];
    Module words(original.begin(), original.begin() + 3);
    words.insert(words.end(), {group + 1, 0});
    bool added = false;
    for (size_t at = 5; at < original.size(); at += original[at] >> 16) {
        if (!added && (original[at] & 0xffff) == spv::OpDecorate) {
            added = true;
            for (uint32_t i = 0; i < 1000; ++i)
                words.insert(words.end(), {3u << 16 | spv::OpDecorate, group, 0});
            words.insert(words.end(),
                         {2u << 16 | spv::OpDecorationGroup, group, 60'000u << 16 | spv::OpGroupDecorate, group});
            words.resize(words.size() + 59'998, 1); // any id
        }
        words.insert(words.end(), original.begin() + static_cast<ptrdiff_t>(at),
                     original.begin() + static_cast<ptrdiff_t>(at + (original[at] >> 16)));
    }
    ASSERT_TRUE(added);
    const auto result = spirv::rewrite(words, {});
    EXPECT_EQ(result.status, Status::Failed);
    EXPECT_EQ(result.error, "decoration groups have too many targets");
}

TEST(BadModules, RandomWords)
{
    std::mt19937 random(7);
    const auto below = [&](size_t n) { return static_cast<uint32_t>(random() % n); };
    int rewritten = 0, failed = 0;
    for (const Module &original : modules()) {
        for (int round = 0; round < 1500; ++round) {
            Module words = original;
            for (uint32_t n = 1 + below(3); n > 0; --n) {
                uint32_t &word = words[below(words.size())];
                switch (below(5)) {
                case 0: word = static_cast<uint32_t>(random()); break;
                case 1: word ^= 1u << below(32); break;
                case 2: word = words[below(words.size())]; break; // often another id, or another opcode
                case 3: word = below(original[3] + 2); break;
                default: word += below(2) == 0 ? 0x10000 : 0xffff0000; break; // a word count off by one
                }
            }
            const auto result = spirv::rewrite(words, {.rootAddress = 1});
            rewritten += result.status == Status::Rewritten;
            failed += result.status == Status::Failed;
            ASSERT_EQ(result.error.empty(), result.status != Status::Failed);
        }
    }
    // Both outcomes occur often.
    EXPECT_GT(rewritten, 1000);
    EXPECT_GT(failed, 1000);
}

// Damage that leaves a module valid must leave the rewritten one valid.
TEST(BadModules, ValidModulesStayValid)
{
    std::mt19937 random(11);
    int checked = 0;
    for (const Module &original : modules())
        for (int round = 0; round < 60; ++round) {
            Module words = original;
            words[5 + random() % static_cast<uint32_t>(words.size() - 5)] =
                static_cast<uint32_t>(random() % original[3]);
            if (words == original || !validate(words).empty())
                continue;
            const auto result = spirv::rewrite(words, {});
            if (result.status != Status::Rewritten)
                continue;
            EXPECT_EQ(validate(result.words), "");
            ++checked;
        }
    EXPECT_GT(checked, 20);
}

TEST(BadModules, OtherByteOrderAndNoSpirv)
{
    EXPECT_EQ(spirv::rewrite({}, {}).status, Status::Unchanged);
    const Module swapped{0x03022307, 0x00050100, 0, 0x01000000, 0};
    EXPECT_EQ(spirv::rewrite(swapped, {}).status, Status::Unchanged);
}

// Also by instructions that the installed headers do not know: the rewritten code would define the id again.
TEST(BadModules, ResultIdDefinedTwice)
{
    for (const uint32_t opcode : {5271u, 5308u, 5326u}) { // of hit objects: custom index (NV), flags, custom index
        Module words = loadShader("hit.rchit", "v15");
        size_t load = 5;
        while ((words[load] & 0xffff) != 61 && load < words.size()) // OpLoad
            load += words[load] >> 16;
        ASSERT_LT(load, words.size());
        const uint32_t type = words[load + 1], result = words[load + 2];
        const auto after = words.begin() + static_cast<ptrdiff_t>(load + (words[load] >> 16));
        words.insert(after, {4u << 16 | opcode, type, result, result});
        EXPECT_EQ(spirv::rewrite(words, {}).status, Status::Failed) << opcode;
    }
}

TEST(BadModules, HugeIdBound)
{
    Module words = loadShader("nested.comp", "v15");
    words[3] = 0xffffffff;
    EXPECT_EQ(spirv::rewrite(words, {}).status, Status::Failed);
}

// A header's phi with many pairs for one block: one copy of the phi for each pair would need 16 GiB.
TEST(BadModules, PhiWithManyEqualPairs)
{
    std::string pairs = " %u0 %entry";
    for (int i = 0; i < 32'000; ++i)
        pairs += " %count %next";
    const Module words = assemble(moduleText("OpBranch %header\n%header = OpLabel\n%count = OpPhi %uint" + pairs + R"(
          OpLoopMerge %end %next None
          OpBranch %check
 %check = OpLabel
 %found = OpRayQueryProceedKHR %bool %q
          OpBranchConditional %found %body %end
  %body = OpLabel
          OpBranch %next
  %next = OpLabel
          OpBranch %header
   %end = OpLabel
)"));
    const auto result = spirv::rewrite(words, {.rootAddress = 0x1000});
    EXPECT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_LT(result.words.size(), 2 * words.size());
}

// Many entry points, each of which calls all of a long chain of functions.
TEST(BadModules, ManyEntryPointsOfManyFunctions)
{
    constexpr uint32_t kMany = 30'000, kVoid = 1, kProc = 2, kFirst = 10;
    Module words = assemble("OpCapability Shader\nOpCapability RayQueryKHR\nOpMemoryModel Logical GLSL450\n");
    words[3] = kFirst + 3 * kMany;
    for (uint32_t i = 0; i < kMany; ++i)
        words.insert(words.end(), {5u << 16 | 15, 5, kFirst + i, 'm', 0}); // OpEntryPoint GLCompute
    words.insert(words.end(), {2u << 16 | 19, kVoid, 3u << 16 | 33, kProc, kVoid});
    for (uint32_t i = 0; i < kMany; ++i) {
        words.insert(words.end(), {5u << 16 | 54, kVoid, kFirst + i, 0, kProc, 2u << 16 | 248, kFirst + kMany + i});
        if (i + 1 < kMany)
            words.insert(words.end(), {4u << 16 | 57, kVoid, kFirst + 2 * kMany + i, kFirst + i + 1});
        words.insert(words.end(), {1u << 16 | 253, 1u << 16 | 56});
    }
    std::string error;
    const auto entries = spirv::readEntryPoints(words, error);
    ASSERT_TRUE(entries) << error;
    EXPECT_EQ(entries->size(), kMany);
}

// The first type of a module may be unknown to the rewriter. Decorations still come before it.
TEST(Modules, DecorationsBeforeAnUnknownType)
{
    constexpr uint32_t kUnknown = 0xfff0;
    Module words = loadShader("nested.comp", "v15");
    size_t at = 5;
    while ((words[at] & 0xffff) != 19) // OpTypeVoid
        at += words[at] >> 16;
    words.insert(words.begin() + static_cast<ptrdiff_t>(at), {2u << 16 | kUnknown, words[3]++});
    const auto result = spirv::rewrite(words, {.rootAddress = 0x1000});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    size_t lastDecoration = 0, unknown = 0;
    spirv::visitInstructions(result.words, [&](spirv::Words in) {
        const auto position = static_cast<size_t>(in.data() - result.words.data());
        if (const uint32_t opcode = spirv::opcodeOf(in); opcode == 71 || opcode == 72) // OpDecorate, OpMemberDecorate
            lastDecoration = position;
        else if (opcode == kUnknown)
            unknown = position;
        return true;
    });
    EXPECT_GT(unknown, lastDecoration);
    Module without = result.words;
    without.erase(without.begin() + static_cast<ptrdiff_t>(unknown),
                  without.begin() + static_cast<ptrdiff_t>(unknown + 2));
    EXPECT_EQ(validate(without), "");
}

// Unknown instructions of ray queries, such as those of SPV_NV_linear_swept_spheres, stay unchanged.
// Spheres are candidates of the type of triangles; since their geometries have no micromaps, they are resolved as
// triangles without one.
TEST(Modules, UnknownInstructionsOfQueriesStay)
{
    constexpr uint32_t kIsSphereHit = 5438, kProceed = 4477, kGetType = 4479;
    const Module original = loadShader("flags.comp", "v15");
    uint32_t type = 0, query = 0, intersection = 0;
    size_t after = 0;
    spirv::visitInstructions(original, [&](spirv::Words in) {
        if (spirv::opcodeOf(in) == kProceed)
            type = in[1];
        else if (spirv::opcodeOf(in) == kGetType && after == 0) {
            query = in[3];
            intersection = in[4];
            after = static_cast<size_t>(in.data() - original.data()) + in.size();
        }
        return true;
    });
    ASSERT_NE(type, 0u);
    ASSERT_NE(after, 0u);
    Module words = original;
    const Module added{5u << 16 | kIsSphereHit, type, words[3]++, query, intersection};
    words.insert(words.begin() + static_cast<ptrdiff_t>(after), added.begin(), added.end());
    const auto result = spirv::rewrite(words, {.rootAddress = 0x1000});
    ASSERT_EQ(result.status, Status::Rewritten) << result.error;
    EXPECT_EQ(std::ranges::search(result.words, added).size(), added.size());
}

} // namespace
} // namespace vellum::test
