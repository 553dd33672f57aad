// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "check/case/case.h"
#include "random_case.h"

namespace
{

using namespace vellum::check;

std::string errorOf(const std::string &text)
{
    try {
        (void)caseFromJson(text);
    } catch (const std::runtime_error &error) {
        return error.what();
    }
    return "no error";
}

// A scene of one triangle, which one ray hits.
Case oneTriangleCase()
{
    Case c{.group = "small", .seed = 18446744073709551615u};
    c.scene.micromaps = {{.triangles = {{.level = 1, .states = {0, 1, 2, 3}}}}};
    oracle::Mesh mesh{.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    mesh.micromap = {.micromap = 0, .indexType = VK_INDEX_TYPE_UINT16, .indices = {0}};
    c.scene.objects = {{.meshes = {mesh}}};
    c.scene.instances = {{.transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}}};
    c.scene.rays = {{.origin = {0.25f, 0.25f, 1}}};
    return c;
}

constexpr std::string_view kSmall = R"({
  "schema": "vellum-check/1",
  "group": "small",
  "seed": 18446744073709551615,
  "scene": {
    "micromaps": [
      {
        "triangles": [{"level": 1, "format": "VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT", "states": "TOto"}]
      }
    ],
    "objects": [
      {
        "meshes": [
          {
            "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
            "micromap": {"micromap": 0, "indexType": "VK_INDEX_TYPE_UINT16", "indices": [0]}
          }
        ]
      }
    ],
    "instances": [{"object": 0, "transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}],
    "rays": [{"origin": [0.25, 0.25, 1], "direction": [0, 0, -1]}]
  }
}
)";

TEST(CaseJson, Readable)
{
    EXPECT_EQ(toJson(oneTriangleCase()), kSmall);
}

// NaN equals itself.
bool sameVertices(const std::vector<Vec3> &a, const std::vector<Vec3> &b)
{
    const auto same = [](float x, float y) { return std::isnan(x) ? std::isnan(y) : !(x < y || x > y); };
    return std::ranges::equal(a, b, [&](const Vec3 &v, const Vec3 &w) { return std::ranges::equal(v, w, same); });
}

TEST(CaseJson, RandomCasesComeBack)
{
    for (uint32_t seed = 0; seed < 200; ++seed) {
        const Case c = randomCase(seed);
        ASSERT_EQ(invalid(c), "") << seed;
        const Case back = caseFromJson(toJson(c));
        ASSERT_EQ(toJson(back), toJson(c)) << seed;
        // Some members are compared directly, in case the text lacks them.
        ASSERT_EQ(back.seed, c.seed);
        ASSERT_EQ(back.steps.size(), c.steps.size());
        ASSERT_EQ(back.build.threads, c.build.threads);
        ASSERT_EQ(back.trace.stage, c.trace.stage);
        ASSERT_EQ(back.scene.rays.size(), c.scene.rays.size());
        for (size_t i = 0; i < c.scene.rays.size(); ++i)
            ASSERT_EQ(std::memcmp(&back.scene.rays[i], &c.scene.rays[i], sizeof(Ray)), 0) << seed << " ray " << i;
        for (size_t i = 0; i < c.scene.instances.size(); ++i)
            ASSERT_EQ(std::memcmp(&back.scene.instances[i].transform, &c.scene.instances[i].transform,
                                  sizeof(VkTransformMatrixKHR)),
                      0);
        for (size_t i = 0; i < c.scene.objects.size(); ++i)
            for (size_t m = 0; m < c.scene.objects[i].meshes.size(); ++m)
                ASSERT_TRUE(
                    sameVertices(back.scene.objects[i].meshes[m].vertices, c.scene.objects[i].meshes[m].vertices));
        for (size_t i = 0; i < c.scene.micromaps.size(); ++i)
            for (size_t t = 0; t < c.scene.micromaps[i].triangles.size(); ++t)
                ASSERT_EQ(back.scene.micromaps[i].triangles[t].states, c.scene.micromaps[i].triangles[t].states);
    }
}

TEST(CaseJson, FloatsComeBackExactly)
{
    Case c = oneTriangleCase();
    oracle::Random random(7);
    const auto anyFloat = [&] {
        for (;;) {
            const auto bits = static_cast<uint32_t>(random());
            float value = 0;
            std::memcpy(&value, &bits, sizeof value);
            if (std::isfinite(value))
                return value;
        }
    };
    c.scene.rays.clear();
    for (int i = 0; i < 20000; ++i)
        c.scene.rays.push_back({.origin = {anyFloat(), anyFloat(), -0.0f}, .tMin = i == 0 ? -0.0f : 0.0f});
    const Case back = caseFromJson(toJson(c));
    for (size_t i = 0; i < c.scene.rays.size(); ++i)
        ASSERT_EQ(std::memcmp(&back.scene.rays[i], &c.scene.rays[i], sizeof(Ray)), 0) << i;
}

TEST(CaseJson, ConditionalMayBeABoolean)
{
    for (const bool conditional : {false, true}) {
        std::string text(kSmall);
        text.insert(text.find("\"scene\""),
                    std::string("\"build\": {\"conditional\": ") + (conditional ? "true" : "false") + "}, ");
        EXPECT_EQ(caseFromJson(text).build.conditional, conditional ? Conditional::False : Conditional::None);
    }
}

TEST(CaseJson, ManyStatesAreLengthsOfRuns)
{
    Case c = oneTriangleCase();
    std::vector<uint8_t> states(size_t{1} << 24, 1);
    states[5] = 2;
    states[6] = 3;
    c.scene.micromaps[0].triangles = {{.level = 12, .states = states}};
    const std::string text = toJson(c);
    EXPECT_NE(text.find("\"5Oto16777209O\""), std::string::npos);
    EXPECT_EQ(caseFromJson(text).scene.micromaps[0].triangles[0].states, states);
}

// Large scenes are short files, as long as most of their elements are alike.
TEST(CaseJson, RunsAreElementsWithACount)
{
    Case c = oneTriangleCase();
    oracle::Mesh mesh = c.scene.objects[0].meshes[0];
    const std::vector<Vec3> triangle = std::exchange(mesh.vertices, {});
    for (uint32_t i = 0; i < 70000; ++i)
        for (const Vec3 &vertex : triangle)
            mesh.vertices.push_back({vertex[0] + 1.5f * static_cast<float>(i % 256),
                                     vertex[1] + 1.5f * static_cast<float>(i / 256), vertex[2]});
    mesh.micromap->indices.assign(70000, 0);
    mesh.micromap->indices[300] = -2;
    for (int32_t i = 0; i < 100; ++i)
        mesh.micromap->indices[400 + static_cast<size_t>(i)] = i + 7;
    c.scene.objects[0].meshes.resize(70001, c.scene.objects[0].meshes[0]);
    c.scene.objects[0].meshes[0] = mesh;
    c.scene.instances.resize(66000, c.scene.instances[0]);
    c.scene.instances[65999].flags = kFlagTwoState;
    c.scene.micromaps[0].triangles.resize(66000, {.level = 0, .states = {3}});
    ASSERT_EQ(invalid(c), "");
    const std::string text = toJson(c);
    EXPECT_LT(text.size(), 64000u);
    for (const char *const part : {"\"repeat\": 70000,", "{\"repeat\": 100, \"index\": 7, \"step\": 1}",
                                   "\"repeat\": 65999, \"object\": 0", "\"repeat\": 65999,", "\"step\": [1.5, 0, 0]"})
        EXPECT_NE(text.find(part), std::string::npos) << part;
    const Case back = caseFromJson(text);
    EXPECT_EQ(toJson(back), text);
    EXPECT_EQ(back.scene.objects[0].meshes[0].vertices, mesh.vertices);
    EXPECT_EQ(back.scene.objects[0].meshes[0].micromap->indices, mesh.micromap->indices);
    EXPECT_EQ(back.scene.objects[0].meshes.size(), c.scene.objects[0].meshes.size());
    EXPECT_EQ(back.scene.instances.size(), c.scene.instances.size());
    EXPECT_EQ(back.scene.micromaps[0].triangles.size(), c.scene.micromaps[0].triangles.size());
}

// A replacement in the JSON of oneTriangleCase() that makes it invalid, and the expected error.
struct Wrong {
    const char *instead;
    const char *with;
    const char *error;
};

class WrongCaseJson : public testing::TestWithParam<Wrong>
{
};

constexpr Wrong kWrong[] = {
    {"{\n  \"schema\"", "\"schema\"", "line 1, column 9: The document root must not be followed by other values."},
    {"\"group\": \"small\",", "\"group\": \"small\"",
     "line 4, column 3: Missing a comma or '}' after an object member."},
    {"vellum-check/1", "vellum-check/2", "schema: is not \"vellum-check/1\""},
    {"  \"schema\": \"vellum-check/1\",\n", "", "schema: is missing"},
    {"\"group\": \"small\"", "\"group\": 3", "group: is not a string"},
    {"\"group\": \"small\"", "\"gruop\": \"small\"", "the case: has an unknown field, \"gruop\""},
    {"\"group\": \"small\"", "\"seed\": 1", "the case: has the field \"seed\" twice"},
    {"18446744073709551615", "-1", "seed: is not a whole number of 64 bits"},
    {"\"group\": \"small\"", "\"memory\": \"none\"", "memory: \"none\" is not one of apart, packed, packed-to-the-end"},
    {"\"group\": \"small\"", "\"steps\": [{\"kind\": \"clone-object\", \"target\": 1}]",
     "steps[0]: object 1 does not exist"},
    {"\"group\": \"small\"", "\"steps\": [{\"kind\": \"compact-micromap\"}]",
     "steps[0]: micromap 0 does not allow compaction"},
    {"\"group\": \"small\"", "\"steps\": [{\"kind\": \"set-indices\", \"other\": 1}]",
     "steps[0]: mesh 1 does not exist"},
    {"\"group\": \"small\"", "\"steps\": {}", "steps: is not a list"},
    {"\"group\": \"small\"", "\"build\": {\"threads\": 0}", "build.threads: 0 is not 1 to 64"},
    {"\"group\": \"small\"", "\"build\": {\"together\": 1}", "build.together: is neither true nor false"},
    {"\"level\": 1", "\"level\": 13", "scene.micromaps[0].triangles[0]: level 13 is above 12"},
    {"\"level\": 1", "\"level\": 2", "scene.micromaps[0].triangles[0]: level 2 has 16 micro-triangles, not 4"},
    {"\"level\": 1, ", "", "scene.micromaps[0].triangles[0].level: is missing"},
    {"FORMAT_4_STATE", "FORMAT_2_STATE", "scene.micromaps[0].triangles[0]: the format lacks one of the states"},
    {"FORMAT_4_STATE", "FORMAT_5_STATE",
     "scene.micromaps[0].triangles[0].format: \"VK_OPACITY_MICROMAP_FORMAT_5_STATE_EXT\" is not one of "
     "VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT"},
    {"TOto", "TOtX", "scene.micromaps[0].triangles[0].states: has a state that is not T, O, t or o"},
    {"TOto", "99999999999999999999999T",
     "scene.micromaps[0].triangles[0].states: more than 268435456 micro-triangles in all"},
    {"TOto", "TOt1", "scene.micromaps[0].triangles[0].states: has a wrong length of a run"},
    {"TOto", "0T4T", "scene.micromaps[0].triangles[0].states: has a wrong length of a run"},
    {"\"indices\": [0]", "\"indices\": [1]",
     "scene.objects[0].meshes[0].micromap: index 1 and base 0 are beyond the 1 triangles of micromap 0"},
    {"\"indices\": [0]", "\"indices\": [-5]", "scene.objects[0].meshes[0].micromap: -5 is no special index"},
    {"\"indices\": [0]", "\"indices\": [0, 0]", "scene.objects[0].meshes[0].micromap: 2 indices for 1 triangles"},
    {"\"indices\": [0]", "\"indices\": [0], \"base\": 4294967295",
     "scene.objects[0].meshes[0].micromap: index 0 and base 4294967295 are beyond the 1 triangles of micromap 0"},
    {"\"indices\": [0]", "\"indices\": [0], \"stride\": 3",
     "scene.objects[0].meshes[0].micromap: stride 3 is no multiple of the index size"},
    {"\"indices\": [0]", "\"indices\": [0], \"indexOffset\": 4294967294",
     "scene.objects[0].meshes[0].micromap: stride or indexOffset too large"},
    {"\"micromap\": 0", "\"micromap\": 1", "scene.objects[0].meshes[0].micromap: micromap 1 does not exist"},
    {"\"micromap\": 0, ", "", "scene.objects[0].meshes[0].micromap: index 0 without a micromap"},
    {"[0, 1, 0]]", "[0, 1]]", "scene.objects[0].meshes[0].vertices[2]: is not a list of 3 numbers"},
    {"[0, 1, 0]]", "[0, 1, 1e39]]", "scene.objects[0].meshes[0].vertices[2]: is out of range"},
    {", [0, 1, 0]]", "]", "scene.objects[0].meshes[0]: 2 vertices are no whole triangles"},
    {"\"object\": 0", "\"object\": 1", "scene.instances[0]: object 1 does not exist"},
    {"\"object\": 0", "\"object\": 0, \"mask\": 256", "scene.instances[0]: mask 256 has more than 8 bits"},
    {"\"object\": 0", "\"object\": 0, \"flags\": [\"SHINY\"]",
     "scene.instances[0].flags[0]: \"SHINY\" is not one of VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR, "
     "VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR, VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR, "
     "VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR, VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_EXT, "
     "VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_EXT"},
    {"[0, 0, 1, 0]]", "[0, 0, 0, 0]]", "scene.instances[0]: the transform cannot be inverted"},
    {"[0, 0, 1, 0]]", "5]", "scene.instances[0].transform[2]: is not a list of 4 numbers"},
    {"\"direction\": [0, 0, -1]", "\"direction\": [0, 0, -1], \"tMin\": -1",
     "scene.rays[0]: tMin -1 is negative or above tMax 1000"},
    {"{\"object\": 0", "{\"repeat\": 0, \"object\": 0", "scene.instances[0].repeat: is 0"},
    {"{\"object\": 0", "{\"repeat\": 4294967295, \"object\": 0",
     "scene.instances[0]: more than 16777216 elements of lists in all"},
    {"{\"level\": 1", "{\"repeat\": 16000000, \"level\": 1, \"states\": \"TOto\", \"level\": 1",
     "scene.micromaps[0].triangles[0]: has the field \"level\" twice"},
    {"\"TOto\"}",
     "\"TOto\", \"repeat\": 16000000}, {\"level\": 5, \"format\": "
     "\"VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT\", \"repeat\": 300000, \"states\": \"1024T\"}",
     "scene.micromaps[0].triangles[1]: more than 268435456 micro-triangles in all"},
    {"\"vertices\": [", "\"vertices\": [{\"repeat\": 2, \"triangle\": [[0, 0, 0]]}, ",
     "scene.objects[0].meshes[0].vertices[0].triangle: is not a list of 3 vertices"},
    {"\"indices\": [0]", "\"indices\": [{\"repeat\": 2}]",
     "scene.objects[0].meshes[0].micromap.indices[0].index: is missing"},
    {"\"direction\": [0, 0, -1]", "\"direction\": [0, 0, -1], \"flags\": [\"OpaqueKHR\", \"NoOpaqueKHR\"]",
     "scene.rays[0]: flags that exclude each other"},
};

TEST_P(WrongCaseJson, IsRejectedInOneLine)
{
    std::string text(kSmall);
    const std::string instead = GetParam().instead;
    const size_t at = text.find(instead);
    ASSERT_NE(at, std::string::npos) << instead;
    text.replace(at, instead.size(), GetParam().with);
    EXPECT_EQ(errorOf(text), GetParam().error);
}

INSTANTIATE_TEST_SUITE_P(, WrongCaseJson, testing::ValuesIn(kWrong));

// Whatever is cut off or changed, there is an error of one line or a valid case.
TEST(CaseJson, DamagedFilesAreRejected)
{
    const std::string whole = toJson(randomCase(3, 2));
    oracle::Random random(11);
    uint32_t rejected = 0;
    for (int i = 0; i < 3000; ++i) {
        std::string text = whole;
        if (i % 4 == 0)
            text.resize(random() % text.size());
        for (int k = 0; k < i % 5; ++k)
            if (!text.empty())
                text[random() % text.size()] = "{}[]\",:0123456789-.eTo"[random() % 22];
        const std::string error = errorOf(text);
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
        rejected += error != "no error" ? 1u : 0u;
    }
    EXPECT_GT(rejected, 1500u);
    EXPECT_NE(errorOf(std::string(1000000, '[')), "no error");
    EXPECT_NE(errorOf("[" + std::string(100000, '9') + "]"), "no error");
    EXPECT_EQ(errorOf(""), "line 1, column 1: The document is empty.");
    EXPECT_EQ(errorOf("[]"), "the case: is not an object");
}

} // namespace
