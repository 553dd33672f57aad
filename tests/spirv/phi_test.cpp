// SPDX-License-Identifier: Apache-2.0
// Loops around proceed calls in SSA form, run before and after the rewrite: the application must see the same, whatever
// candidates are decided in its place.
#include "machine.h"
#include "support.h"

#include <gtest/gtest.h>

#include <ostream>
#include <random>

namespace vellum::test
{
namespace
{

struct Loop {
    const char *name;
    bool flat;
    const char *body;
};

void PrintTo(const Loop &loop, std::ostream *out)
{
    *out << loop.name;
}

#define PROCEED "%r = OpRayQueryProceedKHR %bool %q\n"
#define NAME "%n = OpRayQueryGetIntersectionPrimitiveIndexKHR %uint %q %i0\n"

const Loop kLoops[] = {
    {"Split", true, R"(
        OpBranch %h
   %h = OpLabel
 %sum = OpPhi %uint %u0 %entry %sum2 %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
%sum2 = OpIAdd %uint %sum %n
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %sum
)"},
    {"Merged", true, R"(
        OpBranch %h
   %h = OpLabel
 %sum = OpPhi %uint %u0 %entry %sum2 %c
 %old = OpPhi %uint %u1 %entry %sum %c
 %inv = OpPhi %uint %u2 %entry %inv %c
  %hit = OpPhi %bool %false %entry %true %c
   )" PROCEED R"(
        OpLoopMerge %m %c DontUnroll
        OpBranchConditional %r %body %m
%body = OpLabel
 %bp  = OpPhi %uint %sum %h
   )" NAME R"(
%sum2 = OpIAdd %uint %bp %n
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
 %mp  = OpPhi %uint %old %h
        OpStore %result %sum
        OpStore %result %mp
        OpStore %result %inv
 %s   = OpSelect %uint %hit %u1 %u0
        OpStore %result %s
)"},
    {"ContinuePhi", true, R"(
        OpBranch %h
   %h = OpLabel
 %sum = OpPhi %uint %u0 %entry %next %c
 %alt = OpPhi %uint %u0 %entry %nalt %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
 %bit = OpBitwiseAnd %uint %n %u1
%sum2 = OpIAdd %uint %sum %n
%nalt = OpBitwiseXor %uint %alt %n
 %odd = OpIEqual %bool %bit %u1
        OpSelectionMerge %join None
        OpBranchConditional %odd %yes %join
 %yes = OpLabel
        OpRayQueryConfirmIntersectionKHR %q
 %big = OpULessThan %bool %mask %sum2
        OpBranchConditional %big %m %c
%join = OpLabel
%sum3 = OpIMul %uint %sum2 %u2
        OpBranch %c
   %c = OpLabel
%next = OpPhi %uint %sum %yes %sum3 %join
        OpBranch %h
   %m = OpLabel
 %mp  = OpPhi %uint %sum %k %sum2 %yes
        OpStore %result %mp
        OpStore %result %alt
)"},
    {"SwitchInBody", true, R"(
        OpBranch %h
   %h = OpLabel
 %sum = OpPhi %uint %u0 %entry %next %c
  %sw = OpPhi %uint %u1 %entry %sum %c
   )" PROCEED R"(
        OpLoopMerge %m %c None
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
 %bit = OpBitwiseAnd %uint %n %three
        OpSelectionMerge %join None
        OpSwitch %bit %join 0 %a 1 %b 2 %d
   %a = OpLabel
  %a1 = OpIAdd %uint %sum %n
        OpBranch %c
   %b = OpLabel
        OpBranch %m
   %d = OpLabel
        OpBranch %c
%join = OpLabel
        OpRayQueryConfirmIntersectionKHR %q
        OpBranch %c
   %c = OpLabel
%next = OpPhi %uint %u0 %d %a1 %a %sum %join
        OpBranch %h
   %m = OpLabel
        OpStore %result %sum
        OpStore %result %sw
)"},
    {"ContinuePhiUsedTwice", false, R"(
        OpBranch %h
   %h = OpLabel
   %a = OpPhi %uint %u0 %entry %next %c
   %b = OpPhi %uint %u1 %entry %next %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
  %ab = OpIAdd %uint %a %b
  %x  = OpIAdd %uint %ab %n
        OpBranch %c
   %c = OpLabel
%next = OpPhi %uint %x %body
        OpBranch %h
   %m = OpLabel
        OpStore %result %a
        OpStore %result %b
)"},
    {"BodyIsContinue", true, R"(
        OpBranch %h
   %h = OpLabel
 %inv = OpPhi %uint %u2 %entry %inv %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %c %m
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %inv
)"},
    {"BodyIsContinueWithPhi", true, R"(
        OpBranch %h
   %h = OpLabel
 %any = OpPhi %bool %false %entry %true %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %c %m
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
   %s = OpSelect %uint %any %u1 %u0
        OpStore %result %s
)"},
    {"CodeInContinueIsBody", true, R"(
        OpBranch %h
   %h = OpLabel
   %i = OpPhi %uint %u0 %entry %i2 %c
   %s = OpPhi %uint %u0 %entry %i %c
 %inv = OpPhi %uint %u2 %entry %inv %c
   )" PROCEED R"(
        OpLoopMerge %m %c None
        OpBranchConditional %r %c %m
   %c = OpLabel
  %cp = OpPhi %uint %s %h
   )" NAME R"(
  %i1 = OpIAdd %uint %i %n
  %i2 = OpIAdd %uint %i1 %cp
        OpStore %result %i2
        OpBranch %h
   %m = OpLabel
        OpStore %result %i
        OpStore %result %s
        OpStore %result %inv
)"},
    {"CountingContinue", false, R"(
        OpBranch %h
   %h = OpLabel
   %i = OpPhi %uint %u0 %entry %i2 %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
        OpStore %result %n
        OpBranch %c
   %c = OpLabel
  %i2 = OpIAdd %uint %i %u1
        OpBranch %h
   %m = OpLabel
        OpStore %result %i
)"},
    {"CallResultUsedElsewhere", true, R"(
        OpBranch %h
   %h = OpLabel
%last = OpPhi %bool %false %entry %r %c
   %t = OpPhi %uint %u0 %entry %t2 %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
  %s  = OpSelect %uint %last %n %u1
  %s2 = OpSelect %uint %r %s %u0
  %t2 = OpIAdd %uint %t %s2
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
   %e = OpSelect %uint %r %u1 %u2
        OpStore %result %e
        OpStore %result %t
)"},
    {"StoreBeforeCall", false, R"(
        OpBranch %h
   %h = OpLabel
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   %v = OpLoad %uint %var
  %v2 = OpIAdd %uint %v %u1
        OpStore %var %v2
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
   %w = OpLoad %uint %var
        OpStore %result %w
)"},
    {"LoadBeforeCall", true, R"(
        OpStore %var %u0
        OpBranch %h
   %h = OpLabel
  %p  = OpPhi %uint %u0 %entry %v2 %c
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   %v = OpLoad %uint %var
  %v2 = OpIAdd %uint %v %p
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
   )" NAME R"(
        OpStore %var %n
        OpStore %result %v2
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %v2
)"},
    {"NegatedCondition", false, R"(
        OpBranch %h
   %h = OpLabel
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
 %not = OpLogicalNot %bool %r
        OpBranchConditional %not %m %body
%body = OpLabel
   )" NAME R"(
        OpStore %result %n
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %u1
)"},
    {"BodyOnFalse", false, R"(
        OpBranch %h
   %h = OpLabel
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %m %body
%body = OpLabel
        OpStore %result %u2
        OpBranch %m
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %u1
)"},
    {"CallAfterBody", false, R"(
        OpBranch %h
   %h = OpLabel
   %i = OpPhi %uint %u0 %entry %i2 %c
        OpLoopMerge %m %c None
        OpBranch %body
%body = OpLabel
  %i2 = OpIAdd %uint %i %u1
        OpStore %result %i2
        OpBranch %c
   %c = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %h %m
   %m = OpLabel
        OpStore %result %i
)"},
    // The first loop's decision becomes the only predecessor of the second call's block.
    {"BodyBeginsWithAnotherCall", true, R"(
        OpBranch %h
   %h = OpLabel
        OpLoopMerge %m %c None
        OpBranch %k
   %k = OpLabel
   )" PROCEED R"(
        OpBranchConditional %r %body %m
%body = OpLabel
  %r2 = OpRayQueryProceedKHR %bool %q
        OpSelectionMerge %end None
        OpBranchConditional %r2 %then %end
%then = OpLabel
   )" NAME R"(
        OpStore %result %n
        OpBranch %end
 %end = OpLabel
        OpBranch %c
   %c = OpLabel
        OpBranch %h
   %m = OpLabel
        OpStore %result %u1
)"},
};

class Phis : public testing::TestWithParam<Loop>
{
};

TEST_P(Phis, TheApplicationSeesTheSame)
{
    const Loop &loop = GetParam();
    const Module before = assemble(moduleText(loop.body, "%three = OpConstant %uint 3\n"));
    const Module after = rewriteValid(before);
    const Forms forms = formsOf(after);
    const size_t flat = loop.flat ? 1 : 0;
    EXPECT_EQ(forms.flatCalls, flat) << disassemble(after);
    EXPECT_EQ(forms.innerCalls, count(disassemble(before), "OpRayQueryProceedKHR") - flat);

    std::mt19937 random(1);
    for (int round = 0; round < 300; ++round) {
        std::vector<Candidate> all, visible;
        const uint32_t length = static_cast<uint32_t>(random() % 8);
        for (uint32_t i = 0; i < length; ++i) {
            all.push_back({static_cast<uint32_t>(random() % 200), random() % 2 == 0});
            if (!all.back().decided)
                visible.push_back(all.back());
        }
        ASSERT_EQ(Machine(before, visible).run(), Machine(after, all).run()) << disassemble(after);
    }
}

INSTANTIATE_TEST_SUITE_P(All, Phis, testing::ValuesIn(kLoops), [](const auto &test) { return test.param.name; });

} // namespace
} // namespace vellum::test
