// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <gtest/gtest.h>
#include <limits>

#include "check/case/names.h"
#include "check/groups/random_case.h"
#include "random_case.h"

namespace
{

using namespace vellum::check;

// A change of a random case that breaks a rule, and what is said then, without the place.
struct Break {
    const char *what;
    std::function<bool(Case &)> change; // false: the case lacks what it would change
};

oracle::MeshMicromap *useOf(Case &c, bool withIndices)
{
    for (oracle::Object &object : c.scene.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (mesh.micromap && mesh.micromap->micromap && mesh.triangles() > 0 &&
                (mesh.micromap->indexType != VK_INDEX_TYPE_NONE_KHR) == withIndices)
                return &*mesh.micromap;
    return nullptr;
}

oracle::Mesh *boxesOf(Case &c)
{
    for (oracle::Object &object : c.scene.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (!mesh.boxes.empty())
                return &mesh;
    return nullptr;
}

oracle::Mesh *trianglesOf(Case &c, bool indexed)
{
    for (oracle::Object &object : c.scene.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (!mesh.vertices.empty() && mesh.layout.isIndexed() == indexed)
                return &mesh;
    return nullptr;
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
const auto kAlwaysPossible = [](auto change) {
    return [change](Case &c) {
        change(c);
        return true;
    };
};
const auto kForIndices = [](auto change) {
    return [change](Case &c) {
        oracle::MeshMicromap *use = useOf(c, true);
        if (use != nullptr)
            change(*use, c);
        return use != nullptr;
    };
};
const auto kForBoxes = [](auto change) {
    return [change](Case &c) {
        oracle::Mesh *mesh = boxesOf(c);
        if (mesh != nullptr)
            change(*mesh);
        return mesh != nullptr;
    };
};
// indexed: triangles with indices
template <bool indexed>
constexpr auto kForTriangles = [](auto change) {
    return [change](Case &c) {
        oracle::Mesh *mesh = trianglesOf(c, indexed);
        if (mesh != nullptr)
            change(*mesh);
        return mesh != nullptr;
    };
};
Step stepOf(Step::Kind kind, uint32_t target)
{
    return {.kind = kind, .target = target};
}

QueryPlan queriesOf(std::vector<QueryCommand> commands)
{
    return {.count = 3, .commands = std::move(commands)};
}

const Break kBreaks[] = {
    {"needs an object, an instance and a ray", kAlwaysPossible([](Case &c) { c.scene.rays.clear(); })},
    {"needs an object, an instance and a ray", kAlwaysPossible([](Case &c) { c.scene.instances.clear(); })},
    {"does not exist",
     kAlwaysPossible([](Case &c) { c.scene.instances[0].object = static_cast<uint32_t>(c.scene.objects.size()); })},
    {"has more than 24 bits", kAlwaysPossible([](Case &c) { c.scene.instances[0].customIndex = 1u << 24; })},
    {"the transform is not finite",
     kAlwaysPossible([](Case &c) { c.scene.instances[0].transform.matrix[1][3] = kNan; })},
    {"no such flag", kAlwaysPossible([](Case &c) { c.scene.instances[0].flags |= 0x40; })},
    {"no such flag", kAlwaysPossible([](Case &c) { c.scene.rays[0].flags |= 0x800; })},
    {"is not finite", kAlwaysPossible([](Case &c) { c.scene.rays[0].origin[2] = kNan; })},
    {"is negative or above tMax", kAlwaysPossible([](Case &c) { c.scene.rays[0].tMax = -1; })},
    {"is below tMin", kAlwaysPossible([](Case &c) {
         c.scene.rays[0].tMin = 0.5f;
         c.scene.rays[0].generate = 0.25f;
     })},
    {"flags that exclude each other",
     kAlwaysPossible([](Case &c) { c.scene.rays[0].flags |= kRaySkipTriangles | kRaySkipBoxes; })},
    {"no such rule", kAlwaysPossible([](Case &c) { c.scene.rays[0].rule = 4; })},
    {"no such stage",
     kAlwaysPossible([](Case &c) { c.trace.stage = VK_SHADER_STAGE_TESSELLATION_CONTROL_BIT; })},
    {"needs the compute stage and a descriptor", kAlwaysPossible([](Case &c) {
         c.trace.query = TracePlan::Query::Array;
         c.trace.byAddress = true;
     })},
    {"needs a ray query in the compute stage", kAlwaysPossible([](Case &c) {
         c.trace.query = TracePlan::Query::Plain;
         c.trace.optimized = true;
         c.trace.byAddress = true;
     })},
    {"no such entry point", kAlwaysPossible([](Case &c) { c.trace.otherEntry = static_cast<OtherEntry>(4); })},
    {"shares a function that ends a task shader", kAlwaysPossible([](Case &c) {
         c.trace = {.stage = VK_SHADER_STAGE_TASK_BIT_EXT, .otherEntry = OtherEntry::SharedAfter};
     })},
    {"library 1 is no part before", kAlwaysPossible([](Case &c) {
         c.trace.pipeline.parts = {{{0}, {}, {1}}, {}};
     })},
    {"lacks stage any-hit", kAlwaysPossible([](Case &c) {
         c.trace.pipeline.parts = {{{0, 1, 2, 4, 5, 6, 7, 8, 9}, {2}}};
     })},
    {"is nowhere", kAlwaysPossible([](Case &c) { c.trace.pipeline.parts = {{{0}, {0}}}; })},
    {"has the micromap bit and library 0 lacks it", kAlwaysPossible([](Case &c) {
         c.trace.pipeline.parts = {{{0}, {}}, {{1}, {}, {0}, true}, {{2}, {}, {1}}};
     })},
    {"skips triangles and boxes", kAlwaysPossible([](Case &c) {
         c.trace.pipeline.flags = VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR |
                                  VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR;
     })},
    {"the miss index is beyond the miss records", kAlwaysPossible([](Case &c) {
         c.trace.method = TracePlan::Method::Pipeline;
         c.trace.pipeline.parameters.missIndex = 3;
     })},
    {"rays read beyond the hit records", kAlwaysPossible([](Case &c) {
         c.trace.method = TracePlan::Method::Pipeline;
         c.trace.from = TracePlan::From::RayGeneration;
         c.trace.pipeline = {.table = {.length = 0}};
         c.scene.rays[0].flags = 0;
     })},
    {"a zero miss record", kAlwaysPossible([](Case &c) {
         c.trace.method = TracePlan::Method::Pipeline;
         c.trace.pipeline = {.flags = VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR,
                             .table = {.nullMiss = true}};
     })},
    {"has more than 24 bits", kAlwaysPossible([](Case &c) { c.scene.instances[0].record = 1u << 24; })},
    {"has no host command", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::CloneTop, 0)};
         c.steps[0].host = true;
     })},
    {"only host commands are deferred", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.steps = {stepOf(Step::Kind::ReloadMicromap, *use.micromap)};
         c.steps[0].deferred = true;
     })},
    {"has states that it does not use", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.steps = {stepOf(Step::Kind::ReloadMicromap, *use.micromap)};
         c.steps[0].states = c.scene.micromaps[*use.micromap].triangles;
     })},
    {"has steps", kAlwaysPossible([](Case &c) {
         c.build.single = true;
         c.steps = {stepOf(Step::Kind::CloneTop, 0)};
     })},
    {"other levels or formats than the micromap has", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.steps = {stepOf(Step::Kind::SetStates, *use.micromap)};
         c.steps[0].inPlace = true;
         c.steps[0].states = c.scene.micromaps[*use.micromap].triangles;
         c.steps[0].states[0] = {.level = 7, .states = std::vector<uint8_t>(1u << 14)};
     })},
    {"becomes active or inactive", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::UpdateTop, 0)};
         c.steps[0].instances = c.scene.instances;
         c.steps[0].instances[0].inactive = !c.steps[0].instances[0].inactive;
     })},
    {"which had no micromap when it was built", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.steps = {stepOf(Step::Kind::SetIndices, 0), stepOf(Step::Kind::CloneMicromap, *use.micromap)};
         c.scene.objects = {{.meshes = {{.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}}}};
         for (oracle::Instance &instance : c.scene.instances)
             instance.object = 0;
         c.steps[0].micromapUse = {.micromap = c.steps[1].target, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}};
         c.steps[1].update = true;
     })},
    {"are built on device or host",
     kAlwaysPossible([](Case &c) { c.build.micromaps = BuildCommand::Indirect; })},
    {"are built on the device", kAlwaysPossible([](Case &c) { c.build.structures = BuildCommand::Host; })},
    {"no such flag", kAlwaysPossible([](Case &c) { c.scene.objects[0].flags = 0x1000; })},
    {"no such flag", kAlwaysPossible([](Case &c) { c.scene.topFlags = 0x1000; })},
    {"updates of micromaps and of their data exclude each other",
     kAlwaysPossible([](Case &c) { c.scene.objects[0].flags = kAllowMicromapUpdate | kAllowDataUpdate; })},
    {"updates more than the data of micromaps", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         for (oracle::Object &object : c.scene.objects)
             object.flags = kAllowDataUpdate;
         c.steps = {stepOf(Step::Kind::SetStates, *use.micromap)};
         c.steps[0].states = c.scene.micromaps[*use.micromap].triangles;
         for (oracle::MicromapTriangle &triangle : c.steps[0].states)
             triangle = {.level = triangle.level + 1, .states = std::vector<uint8_t>(4 * triangle.states.size())};
         use.stride.reset();
         use.base = 0;
         use.indices[0] = 0;
         c.steps[0].update = true;
     })},
    {"is no update", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::RebuildObject, 0)};
         c.steps[0].outOfPlace = true;
     })},
    {"is neither a clone nor an update of another structure", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::CompactTop, 0)};
         c.steps[0].exact = true;
     })},
    {"has no addresses of structures or micromaps", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::CloneTop, 0)};
         c.steps[0].relocated = true;
     })},
    {"has no micromaps that come later", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::ReloadObject, 0)};
         c.steps[0].structureFirst = true;
     })},
    {"has no vertices of its own", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::CloneObject, 0)};
         c.steps[0].mirrored = true;
     })},
    {"has no instances", kAlwaysPossible([](Case &c) { c.steps = {stepOf(Step::Kind::RebuildTop, 0)}; })},
    {"is within a render pass", kAlwaysPossible([](Case &c) {
         c.trace = {.stage = VK_SHADER_STAGE_VERTEX_BIT, .secondary = true};
     })},
    {"lack sizes for builds on the host", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.scene.micromaps[*use.micromap].onHost = false;
         c.build.micromaps = BuildCommand::Host;
     })},
    {"height and depth are not 1 to 64", kAlwaysPossible([](Case &c) { c.trace.launch.depth = 0; })},
    {"need a ray generation shader", kAlwaysPossible([](Case &c) {
         c.trace = {.method = TracePlan::Method::Pipeline, .byAddress = true, .callables = true};
     })},
    {"is not together", kAlwaysPossible([](Case &c) {
         c.build.together = false;
         c.build.mixed = true;
     })},
    {"no such form of usage counts",
     kForIndices([](oracle::MeshMicromap &use, Case &c) { c.scene.micromaps[*use.micromap].usage = 8; })},
    {"no such form of usage counts, or of data",
     kForIndices([](oracle::MeshMicromap &use, Case &c) { c.scene.micromaps[*use.micromap].layout = 8; })},
    {"no such form of usage counts", kForIndices([](oracle::MeshMicromap &use, Case &) { use.usage = 8; })},
    {"has queries", kAlwaysPossible([](Case &c) {
         c.steps.clear();
         c.build.single = true;
         c.queries = {{}};
     })},
    {"0 queries, not 1 to", kAlwaysPossible([](Case &c) { c.queries = {{.count = 0}}; })},
    {"uses queries 2 to 3 of a pool of 3",
     kAlwaysPossible([](Case &c) { c.queries = {queriesOf({{.first = 2, .count = 2}})}; })},
    {"writes queries that are not reset", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.kind = QueryCommand::Kind::Write, .targets = {{QueryTarget::Of::Top}}}})};
     })},
    {"writes queries that are not reset", kAlwaysPossible([](Case &c) {
         const QueryCommand write{.kind = QueryCommand::Kind::Write, .targets = {{QueryTarget::Of::Top}}};
         c.queries = {queriesOf({{.count = 3}, write, write})};
     })},
    {"reads queries that were never reset",
     kAlwaysPossible([](Case &c) { c.queries = {queriesOf({{.kind = QueryCommand::Kind::Read}})}; })},
    {"waits for queries that are not written", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.count = 3}, {.kind = QueryCommand::Kind::Read, .wait = true}})};
     })},
    {"copies queries that were never available", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.count = 3}, {.kind = QueryCommand::Kind::Copy, .availability = true}})};
     })},
    {"copies queries that are not available, and", kAlwaysPossible([](Case &c) {
         const QueryCommand write{.kind = QueryCommand::Kind::Write, .targets = {{QueryTarget::Of::Top}}};
         c.queries = {queriesOf({{.count = 3}, write, {.count = 3}, {.kind = QueryCommand::Kind::Copy}})};
     })},
    {"are written to memory that is watched", kAlwaysPossible([](Case &c) {
         c.memory = Memory::Packed;
         c.build.lateInputs = true;
     })},
    {"is not single", kAlwaysPossible([](Case &c) {
         c.build.single = false;
         c.build.backwards = true;
     })},
    {"is used by several threads", kAlwaysPossible([](Case &c) {
         c.build.threads = 2;
         c.build.secondDevice = true;
     })},
    {"needs the compute stage", kAlwaysPossible([](Case &c) {
         c.trace = {.stage = VK_SHADER_STAGE_VERTEX_BIT, .rebound = true};
     })},
    {"need the vertex stage", kAlwaysPossible([](Case &c) { c.trace = {.vertexBuffers = true}; })},
    {"has targets that it does not use, or lacks them", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.count = 3}, {.kind = QueryCommand::Kind::Write}})};
     })},
    {"only the top level has bottom-level pointers", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.count = 3}, {.kind = QueryCommand::Kind::Write, .targets = {{}}}})};
         c.queries[0].property = QueryPlan::Property::BottomLevelPointers;
     })},
    {"the host queries micromaps only", kAlwaysPossible([](Case &c) {
         c.queries = {queriesOf({{.kind = QueryCommand::Kind::WriteOnHost, .targets = {{}}}})};
     })},
    {"does not allow compaction", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         c.scene.micromaps[*use.micromap].flags = 0;
         c.steps.clear();
         c.queries = {queriesOf({{.count = 3},
                                 {.kind = QueryCommand::Kind::Write,
                                  .targets = {{QueryTarget::Of::Micromap, *use.micromap}}}})};
         c.queries[0].property = QueryPlan::Property::CompactedSize;
     })},
    {"exclude each other", kAlwaysPossible([](Case &c) { c.scene.objects[0].flags = 0xc; })},
    {"has 0 meshes, not 1 to 131072", kAlwaysPossible([](Case &c) { c.scene.objects[0].meshes.clear(); })},
    {"an object has more than 20 meshes, for which there are no hit records", kAlwaysPossible([](Case &c) {
         c.scene.objects[0].meshes.resize(21, c.scene.objects[0].meshes[0]);
         c.scene.instances[0].record.reset();
         c.trace.method = TracePlan::Method::Pipeline;
     })},
    {"triangles and boxes in one object",
     kForBoxes([](oracle::Mesh &mesh) { mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}; })},
    {"a box is not finite", kForBoxes([](oracle::Mesh &mesh) { mesh.boxes[0].maxZ = kNan; })},
    {"is no multiple of 8 of at least 24", kForBoxes([](oracle::Mesh &mesh) { mesh.layout.stride = 16; })},
    {"is no multiple of 8 of at least 24", kForBoxes([](oracle::Mesh &mesh) { mesh.layout.stride = 28; })},
    {"primitiveOffset 12 is no multiple of 8", kForBoxes([](oracle::Mesh &mesh) { mesh.layout.primitiveOffset = 12; })},
    {"no such vertex format", kForTriangles<false>([](oracle::Mesh &mesh) {
         mesh.layout.vertexFormat = VK_FORMAT_R32_SFLOAT;
     })},
    {"are no whole triangles", kForTriangles<true>([](oracle::Mesh &mesh) { mesh.vertices.pop_back(); })},
    {"a vertex is not finite", kForTriangles<true>([](oracle::Mesh &mesh) { mesh.vertices[0][1] = kNan; })},
    {"a vertex is not finite", kForTriangles<false>([](oracle::Mesh &mesh) {
         mesh.layout.vertexFormat = VK_FORMAT_R16G16B16A16_SNORM;
         mesh.vertices[0] = {kNan, 0, 0};
     })},
    {"a vertex has a value that VK_FORMAT_R32G32_SFLOAT cannot represent", kForTriangles<false>([](oracle::Mesh &mesh) {
         mesh.layout.vertexFormat = VK_FORMAT_R32G32_SFLOAT;
         mesh.vertices[0] = {0, 0, 1};
     })},
    {"a vertex has a value that VK_FORMAT_R16G16B16A16_SFLOAT cannot represent", kForTriangles<false>([](oracle::Mesh &mesh) {
         mesh.layout.vertexFormat = VK_FORMAT_R16G16B16A16_SFLOAT;
         mesh.vertices[0] = {0.1f, 0, 0};
     })},
    {"of at least", kForTriangles<true>([](oracle::Mesh &mesh) { mesh.layout.stride = 1; })},
    {"primitiveOffset 3 is no multiple of", kForTriangles<true>([](oracle::Mesh &mesh) {
         mesh.layout.primitiveOffset = 3;
     })},
    {"vertex indices have 16 or 32 bits", kForTriangles<true>([](oracle::Mesh &mesh) {
         mesh.layout.indexType = VK_INDEX_TYPE_UINT8_EXT;
         mesh.layout.primitiveOffset = 0;
     })},
    {"indices that 16 bits do not have", kForTriangles<true>([](oracle::Mesh &mesh) {
         mesh.layout.indexType = VK_INDEX_TYPE_UINT16;
         mesh.layout.firstIndex = 0xffff;
     })},
    {"an order of vertices without indices", kForTriangles<false>([](oracle::Mesh &mesh) { mesh.layout.order = 1; })},
    {"the transform cannot be inverted", kForTriangles<false>([](oracle::Mesh &mesh) { mesh.layout.transform.emplace(); })},
    {"no multiple of 16 or without a transform", kForTriangles<true>([](oracle::Mesh &mesh) {
         mesh.layout.transform.reset();
         mesh.layout.transformOffset = 16;
     })},
    {"stride or offsets too large", kForTriangles<false>([](oracle::Mesh &mesh) { mesh.layout.firstVertex = 1u << 28; })},
    {"has a minimum above its maximum", kForBoxes([](oracle::Mesh &mesh) { mesh.boxes[0].minY = 100; })},
    {"boxes have neither micromaps", kForBoxes([](oracle::Mesh &mesh) { mesh.layout.firstVertex = 1; })},
    {"boxes have neither micromaps", kForBoxes([](oracle::Mesh &mesh) { mesh.micromap.emplace(); })},
    {"are beyond the", kForIndices([](oracle::MeshMicromap &use, Case &) {
         use.indices[0] = 0;
         use.base = 100;
     })},
    {"does not fit its type", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         use.indexType = VK_INDEX_TYPE_UINT8_EXT;
         use.stride.reset();
         use.indexOffset = 0;
         use.indices[0] = 252;
         c.scene.micromaps[*use.micromap].triangles.resize(300, c.scene.micromaps[*use.micromap].triangles[0]);
     })},
    {"is no special index", kForIndices([](oracle::MeshMicromap &use, Case &) { use.indices[0] = -5; })},
    {"without a micromap", kForIndices([](oracle::MeshMicromap &use, Case &) {
         use.indices[0] = 0;
         use.micromap.reset();
     })},
    {"is no multiple of the index size", kForIndices([](oracle::MeshMicromap &use, Case &) {
         use.indexType = VK_INDEX_TYPE_UINT32;
         use.stride = 6;
     })},
    {"indices for", kForIndices([](oracle::MeshMicromap &use, Case &) { use.indices.push_back(0); })},
    {"the format lacks one of the states", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         oracle::MicromapTriangle &triangle = c.scene.micromaps[*use.micromap].triangles[0];
         triangle.format = kTwoState;
         triangle.states[0] = 2;
     })},
    {"triangleStride 4 is below 8",
     kForIndices([](oracle::MeshMicromap &use, Case &c) { c.scene.micromaps[*use.micromap].triangleStride = 4; })},
    {"exclude each other",
     kForIndices([](oracle::MeshMicromap &use, Case &c) { c.scene.micromaps[*use.micromap].flags |= 3; })},
    {"without an index buffer is not",
     [](Case &c) {
         oracle::MeshMicromap *use = useOf(c, false);
         if (use != nullptr)
             use->indices[0] = -1;
         return use != nullptr;
     }},
    {"does not exist", kAlwaysPossible([](Case &c) { c.steps = {stepOf(Step::Kind::UpdateObject, 77)}; })},
    {"does not exist", kAlwaysPossible([](Case &c) { c.steps = {stepOf(Step::Kind::CloneMicromap, 77)}; })},
    {"has states that it does not use", kAlwaysPossible([](Case &c) {
         c.steps = {stepOf(Step::Kind::UpdateObject, 0)};
         c.steps[0].states.resize(1);
     })},
    {"two regions write the same byte", kAlwaysPossible([](Case &c) {
         c.build.single = c.build.backwards = false;
         c.addressCopies = {.buffers = {16}, .commands = {{.regions = {{.fromOffset = 8}, {.offset = 3, .fromOffset = 12}}}}};
     })},
    {"has copies at addresses", kAlwaysPossible([](Case &c) {
         c.steps.clear();
         c.queries.clear();
         c.build.single = true;
         c.addressCopies = {.buffers = {16}, .commands = {{.regions = {{.fromOffset = 8}}}}};
     })},
    // A step takes triangles away that an index refers to, and a later one the reference.
    {"are beyond the", kForIndices([](oracle::MeshMicromap &use, Case &c) {
         const uint32_t micromap = *use.micromap;
         use.indices[0] = 1;
         use.base = 0;
         c.scene.micromaps[micromap].triangles.resize(200, c.scene.micromaps[micromap].triangles[0]);
         c.steps = {stepOf(Step::Kind::SetStates, micromap)};
         c.steps[0].states = {c.scene.micromaps[micromap].triangles[0]};
     })},
};

TEST(Invalid, RandomCasesAreValidAndBrokenOnesAreNot)
{
    for (const Break &broken : kBreaks) {
        uint32_t found = 0;
        for (uint32_t seed = 0; seed < 60; ++seed) {
            Case c = randomCase(seed, 3);
            ASSERT_EQ(invalid(c), "") << seed;
            if (!broken.change(c))
                continue;
            ++found;
            EXPECT_NE(invalid(c).find(broken.what), std::string::npos)
                << broken.what << " expected of seed " << seed << ", not: " << invalid(c);
        }
        EXPECT_GT(found, 5u) << broken.what;
    }
}

// BuildInputs shares memory that begins with what is uploaded later.
TEST(VaryInputs, SharedMicromapsAreInThoseBeforeThem)
{
    uint32_t shared = 0, all = 0;
    for (uint32_t seed = 0; seed < 200; ++seed) {
        Case c = randomCase(seed, 3);
        c.steps.clear();
        c.queries.clear();
        if (!invalid(c).empty()) // its plan for rays was for the scene after the steps
            continue;
        Random random(seed);
        varyInputs(random, c);
        EXPECT_EQ(invalid(c), "") << seed;
        const std::vector<oracle::SceneMicromap> &micromaps = c.scene.micromaps;
        for (size_t m = 1; c.build.sharedInputs && m < micromaps.size(); ++m) {
            const auto &to = micromaps[m].triangles, &from = micromaps[m - 1].triangles;
            ASSERT_GE(from.size(), to.size()) << seed;
            shared += std::equal(to.begin(), to.end(), from.begin(), [](const auto &a, const auto &b) {
                return a.level == b.level && a.format == b.format && a.states == b.states;
            });
            ++all;
        }
    }
    EXPECT_GT(all, 10u);
    EXPECT_GT(shared * 5, all);
}

} // namespace
