// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <gtest/gtest.h>

#include "random_case.h"

namespace
{

using namespace vellum::check;

Case smallCase()
{
    Case c{.group = "small", .seed = 7};
    c.scene.micromaps = {{.triangles = {{.states = {0}}, {.level = 1, .states = {1, 3, 2, 0}}},
                          .flags = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT}};
    oracle::Mesh mesh{.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    mesh.micromap = {.micromap = 0, .indexType = VK_INDEX_TYPE_UINT16, .indices = {0}, .base = 1};
    c.scene.objects = {{.meshes = {mesh}}};
    c.scene.instances = {
        {.transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}, .mask = 1, .flags = kFlagTwoState}};
    c.scene.rays = {{.origin = {0.7f, 0.1f, 1}}};
    c.steps = {{.kind = Step::Kind::CompactMicromap, .update = true}, {.kind = Step::Kind::CloneTop}};
    return c;
}

TEST(Account, StatesStepsExpectedAndFound)
{
    const Case c = smallCase();
    ASSERT_EQ(invalid(c), "");
    EXPECT_EQ(accountOf(c, {.cause = "x", .detail = "nothing committed", .ray = 0}, Api::Ext),
              R"(Case of group small, seed 7, by VK_EXT_opacity_micromap.

Commands:
  1. vkCmdBuildMicromapsEXT builds micromap 0, flags VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT:
     triangle 0: level 0, 4-state: 1 transparent
     triangle 1: level 1, 4-state: 1 transparent, 1 opaque, 1 unknown-transparent, 1 unknown-opaque
  2. vkCmdBuildAccelerationStructuresKHR builds object 0, a bottom-level structure, flags none and those that what follows needs:
     geometry 0: 1 triangle, not opaque, micromap 0, VK_INDEX_TYPE_UINT16 [0], baseTriangle 1
  3. vkCmdCopyMicromapEXT compacts micromap 0 to the size that a query reports; the structures that use it are updated (MODE_UPDATE).
  4. vkCmdBuildAccelerationStructuresKHR builds the top level:
     instance 0: object 0, flags VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_EXT, mask 0x1
  5. vkCmdCopyAccelerationStructureKHR clones the top level.

Ray 0 of 1, traced by a ray query in stage VK_SHADER_STAGE_COMPUTE_BIT:
origin (0.7, 0.1, 1), direction (0, 0, -1), t 0 to 1000, cull mask 0xff, flags none; candidates are confirmed: never.

Expected:
It meets triangle 0 of geometry 0 of instance 0 at t = 1, barycentrics (0.7, 0.1).
  - Index 0 + baseTriangle 1: triangle 1 of micromap 0, level 1. Micro-triangle 2 of 4 is unknown-transparent.
  - The instance forces two states: unknown-transparent is transparent, unknown-opaque is opaque.
  - So it is ignored: no shader sees it.

Found:
nothing committed
)");
}

TEST(Account, CopiesAtAddresses)
{
    Case c = smallCase();
    c.addressCopies = {.buffers = {64, 32},
                       .width = 4,
                       .commands = {{.regions = {{.buffer = 1, .spare = 3, .fromOffset = 5}}, .fullyBound = true},
                                    {.kind = AddressCommand::Kind::CopyFromImage,
                                     .regions = {{.offset = 8, .x = 1, .width = 2, .rowLength = 3}}},
                                    {.kind = AddressCommand::Kind::CopyToImage, .regions = {{.spare = 1}}},
                                    {.kind = AddressCommand::Kind::Update, .regions = {{.offset = 4}}},
                                    {.kind = AddressCommand::Kind::Fill, .regions = {{.size = 8}}, .value = 17}}};
    ASSERT_EQ(invalid(c), "");
    const std::string text = accountOf(c, {.cause = "x", .detail = "wrong byte"}, Api::Khr);
    EXPECT_NE(text.find(R"(
  2. Commands at device addresses of buffers of 64, 32 bytes, with a barrier after each:
     command 0: vkCmdCopyMemoryKHR, FULLY_BOUND:
       4 bytes from buffer 0 + 5 to buffer 1 + 0, in a range of 7 bytes
     command 1: vkCmdCopyImageToMemoryKHR:
       from level 0, layers 0 to 0, 2 x 1 x 1 texels at (1, 0, 0) to buffer 0 + 8, addressRowLength 3, addressImageHeight 0
     command 2: vkCmdCopyMemoryToImageKHR:
       from buffer 0 + 0 to level 0, layers 0 to 0, 1 x 1 x 1 texels at (0, 0, 0), addressRowLength 0, addressImageHeight 0, in a range of 5 bytes
     command 3: vkCmdUpdateMemoryKHR:
       4 bytes at buffer 0 + 4
     command 4: vkCmdFillMemoryKHR:
       8 bytes at buffer 0 + 0, with 0x00000011
     The image: 4 x 1 x 1 VK_FORMAT_R8G8B8A8_UNORM, 1 level, 1 layer, VK_IMAGE_LAYOUT_GENERAL.
)"),
              std::string::npos)
        << text;
}

struct Rule {
    const char *name;
    std::function<void(Case &)> change;
    const char *line;
};

class AccountRules : public testing::TestWithParam<Rule>
{
};

oracle::Mesh &meshOf(Case &c)
{
    return c.scene.objects[0].meshes[0];
}

const Rule kRules[] = {
    {"NoMicromap", [](Case &c) { meshOf(c).micromap.reset(); },
     "  - The triangle has no micromap; its geometry is not opaque.\n  - So it is non-opaque: a candidate.\n"},
    {"SpecialIndex", [](Case &c) { meshOf(c).micromap->indices = {-2}; },
     "  - Its index is -2, the special index for opaque.\n  - The instance forces two states: unknown-transparent is "
     "transparent, unknown-opaque is opaque.\n  - So it is opaque: accepted, and no candidate.\n"},
    {"Disabled",
     [](Case &c) {
         c.scene.instances[0].flags = kFlagDisable;
         meshOf(c).opaque = true;
     },
     "  - The instance disables micromaps; the geometry is opaque (VK_GEOMETRY_OPAQUE_BIT_KHR).\n  - So it is opaque: "
     "accepted, and no candidate.\n"},
    {"ForceNoOpaque",
     [](Case &c) {
         c.scene.instances[0].flags = VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR;
         c.scene.rays[0].origin = {0.2f, 0.2f, 1};
     },
     "Micro-triangle 0 of 4 is opaque.\n  - The instance forces what is not transparent to be non-opaque.\n  - So it "
     "is non-opaque: a candidate.\n"},
    {"Culled",
     [](Case &c) {
         c.scene.rays[0].flags = kRayCullOpaque;
         c.scene.rays[0].origin = {0.2f, 0.2f, 1};
     },
     "  - The ray culls it by its opacity.\n"},
    {"Missed",
     [](Case &c) {
         c.scene.rays[0].origin = {5, 5, 1};
     },
     "It meets nothing.\n"},
};

TEST_P(AccountRules, NamedInTheAccount)
{
    Case c = smallCase();
    GetParam().change(c);
    ASSERT_EQ(invalid(c), "");
    const std::string account = accountOf(c, {.ray = 0}, Api::Khr);
    EXPECT_NE(account.find(GetParam().line), std::string::npos) << account;
}

INSTANTIATE_TEST_SUITE_P(, AccountRules, testing::ValuesIn(kRules),
                         [](const auto &rule) { return std::string(rule.param.name); });

// Equal elements are listed in one line, however many there are.
TEST(Account, ManyEqualElementsAreShort)
{
    Case c = smallCase();
    c.steps.clear();
    c.scene.objects[0].meshes.resize(70000, c.scene.objects[0].meshes[0]);
    c.scene.objects[0].meshes[300].opaque = true;
    c.scene.instances.resize(1000, c.scene.instances[0]);
    ASSERT_EQ(invalid(c), "");
    const std::string account = accountOf(c, {}, Api::Khr);
    for (const char *const line :
         {"     geometries 0 to 299, each: 1 triangle, not opaque",
          "     geometry 300: 1 triangle, VK_GEOMETRY_OPAQUE_BIT_KHR",
          "     geometries 301 to 69999, each: 1 triangle, not opaque", "     instances 0 to 999, each: object 0"})
        EXPECT_NE(account.find(line), std::string::npos) << line << "\n" << account;
    EXPECT_LT(account.size(), 2000u);
}

// A failure about a size has no expected hit of a ray.
TEST(Account, SizeFailuresHaveNoRay)
{
    const std::string account =
        accountOf(smallCase(), {.cause = "x", .detail = "a build wrote beyond its micromap (...)"}, Api::Khr);
    EXPECT_EQ(account.find("Expected:"), std::string::npos) << account;
    EXPECT_NE(
        account.find("1 ray traced by a ray query in stage VK_SHADER_STAGE_COMPUTE_BIT.\n\nFound:\na build wrote"),
        std::string::npos)
        << account;
}

// The number of a command as the account writes it.
std::string numberText(size_t number)
{
    const std::string text = std::to_string(number) + ". ";
    return "\n" + std::string(text.size() < 5 ? 5 - text.size() : 0, ' ') + text;
}

// Each has a numbered line for each build and each step.
TEST(Account, NamesUnusualOptionsOfBuildsAndQueries)
{
    Case c = smallCase();
    c.scene.micromaps[0].usage = kUsageZeros | kUsageSplit;
    c.scene.micromaps[0].layout = kDataGaps;
    c.scene.objects[0].meshes[0].micromap->usage = kUsageDescending;
    c.scene.topFlags = VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR;
    c.build.together = c.build.mixed = true;
    c.build.sharedInputs = c.build.aliasedInputs = c.build.lateInputs = c.build.secondDevice = true;
    c.build.conditional = Conditional::FalseAtAddress;
    c.steps[0].outOfPlace = true;
    c.steps[1].exact = true;
    c.queries = {{.count = 2,
                  .commands = {
                      {.count = 2},
                      {.kind = QueryCommand::Kind::Write, .count = 2, .targets = {{QueryTarget::Of::Top}, {}}},
                      {.kind = QueryCommand::Kind::Copy,
                       .first = 1,
                       .wide = true,
                       .availability = true,
                       .offset = 1,
                       .padding = 2},
                  }}};
    ASSERT_EQ(invalid(c), "");
    const std::string account = accountOf(c, {}, Api::Khr);
    for (const char *const line : {
             ", usage counts: zeros, split, data of triangles: gaps:",
             "baseTriangle 1, usage counts: descending\n",
             "builds the top level, flags VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR and those",
             "Those without micromaps are built by the command that builds the micromaps.",
             "Inputs that other inputs begin with are in their memory.",
             "A second buffer has the first half of the memory of each input.",
             "Inputs are written when the commands are recorded.",
             "A second device carries out the same,",
             "It begins by vkCmdBeginConditionalRendering2EXT.",
             "updated to a new structure (MODE_UPDATE)",
             "first to one as large as VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR reports",
             "A pool of 2 queries of serialization-size:\n",
             "vkCmdResetQueryPool of queries 0 to 1\n",
             "vkCmdWrite...Properties of queries 0 to 1, the top level, object 0\n",
             "vkCmdCopyQueryPoolResults of queries 1 to 1, 64 bits, with availability, at offset 8, 16 bytes between",
         })
        EXPECT_NE(account.find(line), std::string::npos) << line << "\n" << account;
}

TEST(Account, CommandBuffersInReverseOrder)
{
    Case c = smallCase();
    c.steps.clear();
    c.build.single = c.build.backwards = c.build.unrelated = c.trace.twice = true;
    c.build.conditional = Conditional::FalseAtAddress;
    const std::string account = accountOf(c, {.cause = "x", .detail = "found", .ray = 0}, Api::Khr);
    for (const std::string_view text :
         {"     All builds and the rays are in three command buffers of one submission, which are recorded in reverse "
          "order: of the micromaps, the objects, and the rest.\n",
          "conditional rendering whose predicate is false.\n     It begins by vkCmdBeginConditionalRendering2EXT.\n",
          "The command buffer is submitted twice, those of the micromaps and the objects once.\n"})
        EXPECT_NE(account.find(text), std::string::npos) << text << account;
}

TEST(Account, RandomCases)
{
    for (uint32_t seed = 0; seed < 100; ++seed) {
        const Case c = randomCase(seed, 3);
        const std::string account = accountOf(c, {.cause = "x", .detail = "found", .ray = 2}, Api::Khr);
        const size_t commands = c.scene.micromaps.size() + c.scene.objects.size() + c.steps.size() + c.queries.size() +
                                1 + (c.addressCopies.commands.empty() ? 0 : 1);
        EXPECT_NE(account.find(numberText(commands)), std::string::npos) << account;
        EXPECT_EQ(account.find(numberText(commands + 1)), std::string::npos) << account;
        EXPECT_EQ(account.find('?'), std::string::npos) << account;
        EXPECT_NE(account.find("Ray 2 of 3"), std::string::npos);
    }
}

} // namespace
