// SPDX-License-Identifier: Apache-2.0
// The group about scenes that are large in one respect. What rays aim at are a few elements with high numbers, each
// unlike the many others, which are equal: a device that loses a bit of a number confuses them.
#include <array>
#include <set>

#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

constexpr float kPitch = 1.5f;           // of triangles in a grid
constexpr uint32_t kGrid = 256;          // triangles in a row of it
constexpr Vec3 kAside{-30, -30, 0};      // where no ray is
constexpr uint32_t kManyMore = 1u << 16; // numbers of more than 16 bits
constexpr uint32_t kFillers = 4, kPalette = 12;

// More than `least` by up to an eighth, or up to 300.
uint32_t above(Random &random, uint32_t least)
{
    return least + 1 + below(random, std::min(least / 8, 300u));
}

// Numbers below `count` at which a field of few bits ends, some others, and the last one.
std::vector<uint32_t> interesting(Random &random, uint32_t count)
{
    std::set<uint32_t> numbers{0, count - 1};
    for (const uint32_t bits : {4u, 6u, 7u, 8u, 10u, 12u, 15u, 16u}) {
        const uint32_t end = 1u << bits;
        if (end < count)
            numbers.insert(
                {end - 1, end, end + below(random, std::min(end, count - end)), end + below(random, count - end)});
    }
    while (numbers.size() < std::min(count, 36u))
        numbers.insert(below(random, count));
    return {numbers.begin(), numbers.end()};
}

// A scene with one object in place, and a micromap: kFillers triangles that have one state each, then others.
Case paletteCase(Random &random)
{
    Case c;
    c.scene.edge = 4e-4f; // coordinates of up to 400
    c.scene.objects.resize(1);
    c.scene.instances = {instanceInPlace(random)};
    oracle::SceneMicromap &palette = c.scene.micromaps.emplace_back();
    for (uint8_t state = 0; state < kFillers; ++state)
        palette.triangles.push_back({.level = 0, .format = kFourState, .states = {state}});
    while (palette.triangles.size() < kPalette)
        palette.triangles.push_back(oracle::randomTriangle(random, 2));
    return c;
}

// An index into the palette or a special one, with another state than the filler of that number.
int32_t otherThan(Random &random, uint32_t filler)
{
    for (;;) {
        const auto index = static_cast<int32_t>(below(random, kPalette + 4)) - 4;
        if (index != static_cast<int32_t>(filler) && index != -1 - static_cast<int32_t>(filler))
            return index;
    }
}

Vec3 placeInGrid(uint32_t number, uint32_t width = kGrid)
{
    return {kPitch * static_cast<float>(number % width), kPitch * static_cast<float>(number / width), 0};
}

void maybeByPipeline(Random &random, Case &c, const DeviceLimits &limits)
{
    if (limits.pipelines && chance(random, 30))
        c.trace.method = TracePlan::Method::Pipeline;
}

Case geometries(Random &random, uint32_t count)
{
    Case c = paletteCase(random);
    const uint32_t filler = below(random, 2); // a state that no ray takes for an unknown one
    oracle::Mesh plain;
    plain.opaque = chance(random, 50);
    appendTriangle(plain.vertices, kAside);
    plain.micromap = {.micromap = 0, .indexType = VK_INDEX_TYPE_UINT32, .indices = {static_cast<int32_t>(filler)}};
    std::vector<oracle::Mesh> &meshes = c.scene.objects[0].meshes;
    meshes.assign(count, plain);
    uint32_t place = 0;
    for (const uint32_t number : interesting(random, count)) {
        oracle::Mesh &mesh = meshes[number];
        mesh.opaque = chance(random, 50);
        mesh.vertices.clear();
        const Vec3 at = placeInGrid(place++, 8);
        appendTriangle(mesh.vertices, at);
        if (chance(random, 10))
            mesh.micromap.reset();
        else
            mesh.micromap->indices = {otherThan(random, filler)};
        aimAt(random, c.scene, at, 2, 3);
    }
    return c;
}

Case triangles(Random &random, const DeviceLimits &limits, uint32_t count)
{
    Case c = paletteCase(random);
    const uint32_t filler = below(random, 2); // a state that no ray takes for an unknown one
    oracle::Mesh &mesh = c.scene.objects[0].meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    for (uint32_t i = 0; i < count; ++i)
        appendTriangle(mesh.vertices, placeInGrid(i));
    constexpr std::array types{VK_INDEX_TYPE_UINT32, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT8_EXT};
    mesh.micromap = {.micromap = 0,
                     .indexType = types[below(random, limits.byteIndices ? 3 : 2)],
                     .indices = std::vector<int32_t>(count, static_cast<int32_t>(filler))};
    for (const uint32_t number : interesting(random, count)) {
        mesh.micromap->indices[number] = otherThan(random, filler);
        aimAt(random, c.scene, placeInGrid(number), 2, 3);
    }
    maybeByPipeline(random, c, limits);
    return c;
}

// Triangles whose structure is copied, compacted and serialized.
Case copiedTriangles(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    Case c = triangles(random, limits, above(random, 1u << 10));
    c.steps = {{.kind = Kind::CloneObject}, {.kind = Kind::CompactObject}};
    if (limits.serializesMicromaps())
        c.steps.push_back({.kind = Kind::ReloadObject});
    if (chance(random, 50))
        std::swap(c.steps.front(), c.steps.back());
    return c;
}

// An update of triangles that gives a few of them other indices.
template <bool outOfPlace>
Case updatedTriangles(Random &random, const DeviceLimits &limits)
{
    Case c = triangles(random, limits, above(random, 1u << 10));
    oracle::MeshMicromap use = *c.scene.objects[0].meshes[0].micromap;
    const int32_t filler = std::ranges::count(use.indices, 0) > std::ranges::count(use.indices, 1) ? 0 : 1;
    for (int32_t &index : use.indices)
        if (index != filler || chance(random, 5))
            index = otherThan(random, static_cast<uint32_t>(filler));
    c.steps = {{.kind = Step::Kind::SetIndices, .update = true, .outOfPlace = outOfPlace, .micromapUse = use}};
    return c;
}

Case instances(Random &random, const DeviceLimits &limits, uint32_t count)
{
    Case c = paletteCase(random);
    oracle::Mesh &mesh = c.scene.objects[0].meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    appendTriangle(mesh.vertices, {});
    // All states.
    c.scene.micromaps[0].triangles.push_back({.level = 1, .format = kFourState, .states = {0, 1, 2, 3}});
    mesh.micromap = {.micromap = 0, .indexType = VK_INDEX_TYPE_UINT32, .indices = {kPalette}};
    oracle::Instance plain = instanceInPlace(random);
    for (size_t i = 0; i < 3; ++i)
        plain.transform.matrix[i][3] = kAside[i];
    c.scene.instances.assign(count, plain);
    uint32_t place = 0;
    for (const uint32_t number : interesting(random, count)) {
        oracle::Instance &instance = c.scene.instances[number];
        const Vec3 at = placeInGrid(place++, 8);
        instance.customIndex = below(random, 1u << 24);
        for (size_t i = 0; i < 3; ++i)
            instance.transform.matrix[i][3] = at[i];
        do
            instance.flags = oracle::randomInstance(random, 1, {}).flags;
        while (instance.flags == 0);
        aimAt(random, c.scene, at, 1, 4);
    }
    c.build.instancePointers = chance(random, 30);
    constexpr std::array kinds{Step::Kind::CloneTop, Step::Kind::CompactTop, Step::Kind::ReloadTop};
    if (chance(random, 50))
        addSteps(random, c, kinds, 1, limits);
    maybeByPipeline(random, c, limits);
    return c;
}

// An update of the top level that gives instances other flags and custom indices.
Case updatedInstances(Random &random, const DeviceLimits &limits)
{
    Case c = instances(random, limits, above(random, 1u << 10));
    c.steps.clear();
    if (limits.has(Fault::InstanceBehindInvisible)) // as randomStep
        return c;
    Step step{.kind = Step::Kind::UpdateTop, .outOfPlace = chance(random, 50), .instances = c.scene.instances};
    for (oracle::Instance &instance : step.instances) {
        instance.flags = oracle::randomInstance(random, 1, {}).flags;
        instance.customIndex = below(random, 1u << 24);
    }
    c.steps.push_back(std::move(step));
    return c;
}

// Hit tables of megabytes, whose records are only handles: instances reach those around multiples of powers of two of
// bytes, most of which are zero.
Case manyRecords(Random &random, const DeviceLimits &limits)
{
    constexpr uint32_t kAround = 6, kHandle = 32;
    constexpr std::array kEnds{1u << 14, 1u << 16, 1u << 18, 1u << 20, 1u << 21, 3u << 20}; // bytes
    Case c = instances(random, limits, kEnds.size() * kAround);
    if (!limits.pipelines)
        return c;
    c.steps.clear();
    c.trace.method = TracePlan::Method::Pipeline;
    c.trace.pipeline.table.content = RecordData::None;
    using oracle::HitRecord;
    std::vector<HitRecord> &records = c.trace.pipeline.table.records;
    constexpr std::array kKinds{HitRecord::Null, HitRecord::Null, HitRecord::Null, HitRecord::WithoutAnyHit};
    for (uint32_t i = 0; i < 7; ++i)
        records.push_back(kKinds[below(random, kKinds.size())]);
    for (uint32_t i = 0; i < c.scene.instances.size(); ++i) {
        c.scene.instances[i].record = kEnds[i % kEnds.size()] / kHandle + i / kEnds.size() - 2;
        c.scene.instances[i].flags = chance(random, 70) ? 0 : c.scene.instances[i].flags;
    }
    return c;
}

// Adds a row of triangles with these triangles of the micromap, and rays at micro-triangles of that level.
void addUses(Random &random, Case &c, const std::vector<uint32_t> &numbers, VkIndexType type, uint32_t base,
             uint32_t level = 2)
{
    std::vector<oracle::Mesh> &meshes = c.scene.objects[0].meshes;
    oracle::Mesh &mesh = meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    mesh.micromap = {.micromap = 0, .indexType = type, .base = base};
    for (const uint32_t number : numbers) {
        Vec3 place = placeInGrid(static_cast<uint32_t>(mesh.micromap->indices.size()));
        place[1] = kPitch * static_cast<float>(meshes.size());
        appendTriangle(mesh.vertices, place);
        mesh.micromap->indices.push_back(static_cast<int32_t>(number - base));
        aimAt(random, c.scene, place, level, 4);
    }
}

// A micromap of `count` triangles, of which those of these numbers are unlike the others.
Case micromapCase(Random &random, const DeviceLimits &limits, uint32_t count, const std::vector<uint32_t> &numbers)
{
    Case c = paletteCase(random);
    const auto filler = static_cast<uint8_t>(below(random, 2));
    std::vector<oracle::MicromapTriangle> &all = c.scene.micromaps[0].triangles;
    all.assign(count, {.level = 0, .format = kFourState, .states = {filler}});
    for (const uint32_t number : numbers) {
        do
            all[number] = oracle::randomTriangle(random, 2);
        while (std::ranges::count(all[number].states, filler) > 0);
    }
    if (chance(random, 60))
        c.scene.micromaps[0].triangleStride = oracle::randomTriangleStride(random, limits.oddStrides());
    return c;
}

Case micromapTriangles(Random &random, const DeviceLimits &limits, uint32_t count)
{
    const uint32_t most = count > kManyMore ? kManyMore : 1u << 10;
    std::vector<uint32_t> numbers = interesting(random, count);
    // Several beyond each base.
    for (uint32_t i = 0; i < 8; ++i)
        numbers.push_back(count - 1 - below(random, (count - most + 1) / 2));
    Case c = micromapCase(random, limits, count, numbers);
    addUses(random, c, numbers, VK_INDEX_TYPE_UINT32, 0);
    // Bases of more than 8 bits; and of more than 10 or 16, then also without indices.
    for (const uint32_t base : {257 + below(random, count / 4), most + below(random, (count - most + 1) / 2)}) {
        std::vector<uint32_t> rest;
        for (const uint32_t number : numbers)
            if (number >= base && number - base <= 0xfffbu - 1)
                rest.push_back(number);
        const VkIndexType type = chance(random, 50) ? VK_INDEX_TYPE_UINT16 : VK_INDEX_TYPE_UINT32;
        addUses(random, c, rest, type, base);
    }
    oracle::Mesh &direct = c.scene.objects[0].meshes.back();
    if (chance(random, 50)) {
        const uint32_t base = direct.micromap->base;
        const auto used = static_cast<uint32_t>(direct.vertices.size() / 3);
        direct.micromap->indexType = VK_INDEX_TYPE_NONE_KHR;
        direct.micromap->base = std::min(base, count - used);
        for (uint32_t i = 0; i < used; ++i)
            direct.micromap->indices[i] = static_cast<int32_t>(i);
    }
    maybeByPipeline(random, c, limits);
    return c;
}

// A micromap that may be compacted, of so many triangles, of which some in each block of 256 have levels whose data is
// shared where it is equal, as that of some of them is; it is compacted, and sometimes copied and serialized before.
Case sharedData(Random &random, const DeviceLimits &limits, uint32_t count)
{
    using Kind = Step::Kind;
    constexpr uint32_t kBlock = 256;
    const std::vector<uint32_t> some = interesting(random, count);
    std::set<uint32_t> numbers(some.begin(), some.end());
    for (uint32_t first = 0; first < count; first += kBlock)
        numbers.insert(first + below(random, std::min(kBlock, count - first)));
    const std::vector<uint32_t> all(numbers.begin(), numbers.end());
    Case c = micromapCase(random, limits, count, all);
    oracle::SceneMicromap &micromap = c.scene.micromaps[0];
    micromap.flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    // In half of the cases, the others have equal data of such a level.
    const oracle::MicromapTriangle plain = oracle::mixedTriangle(random, kRequiredLevel, kTwoState);
    const bool fine = chance(random, 50);
    std::vector<uint32_t> earlier; // of `numbers`; some of the others have the data of one of these, of any block
    for (uint32_t number = 0; number < count; ++number) {
        oracle::MicromapTriangle &triangle = micromap.triangles[number];
        if (!numbers.contains(number)) {
            if (fine)
                triangle = plain;
            continue;
        }
        if (earlier.size() > 1 && chance(random, 40))
            triangle = micromap.triangles[earlier[below(random, static_cast<uint32_t>(earlier.size()))]];
        else
            triangle = oracle::mixedTriangle(random, kRequiredLevel, chance(random, 50) ? kTwoState : kFourState);
        earlier.push_back(number);
    }
    for (size_t first = 0; first < all.size(); first += kGrid)
        addUses(random, c,
                {all.begin() + static_cast<ptrdiff_t>(first),
                 all.begin() + static_cast<ptrdiff_t>(std::min<size_t>(first + kGrid, all.size()))},
                VK_INDEX_TYPE_UINT32, 0, kRequiredLevel);
    if (chance(random, 40))
        c.steps.push_back({.kind = chance(random, 50) ? Kind::CloneMicromap : Kind::ReloadMicromap});
    c.steps.push_back({.kind = Kind::CompactMicromap});
    maybeByPipeline(random, c, limits);
    return c;
}

// More than two blocks of 256 micromap triangles, whose data a device may have to move: it has gaps, so that it takes
// more bytes than the triangles need, or the build is lossy.
template <bool mayBeLossy>
Case movedData(Random &random, const DeviceLimits &limits)
{
    const uint32_t count = above(random, 1u << 9);
    const std::vector<uint32_t> numbers = interesting(random, count);
    Case c = micromapCase(random, limits, count, numbers);
    oracle::SceneMicromap &micromap = c.scene.micromaps[0];
    const bool lossy = mayBeLossy && limits.api == Api::Khr;
    micromap.flags |= lossy ? kLossy : 0;
    micromap.layout = kDataGaps | below(random, 8);
    for (oracle::MicromapTriangle &triangle : micromap.triangles)
        triangle = oracle::mixedTriangle(random, kRequiredLevel, !lossy && chance(random, 10) ? kTwoState : kFourState);
    addUses(random, c, numbers, VK_INDEX_TYPE_UINT16, 0, kRequiredLevel);
    maybeByPipeline(random, c, limits);
    return c;
}

// Indices whose highest bit is set, and which are not special.
Case shortIndices(Random &random, const DeviceLimits &limits)
{
    constexpr uint32_t kOf16Bits = 0xfffc, kOf8Bits = 0xfc; // number of indices that are not special
    std::set<uint32_t> bytes{0x7f, 0x80, kOf8Bits - 1}, words{0x7fff, 0x8000, kOf16Bits - 1};
    while (bytes.size() < 12)
        bytes.insert(0x80 + below(random, kOf8Bits - 0x80));
    while (words.size() < 24)
        words.insert(0x8000 + below(random, kOf16Bits - 0x8000));
    std::vector<uint32_t> numbers(words.begin(), words.end());
    numbers.insert(numbers.end(), bytes.begin(), bytes.end());
    Case c = micromapCase(random, limits, above(random, kOf16Bits), numbers);
    addUses(random, c, {words.begin(), words.end()}, VK_INDEX_TYPE_UINT16, 0);
    addUses(random, c, {bytes.begin(), bytes.end()},
            limits.byteIndices ? VK_INDEX_TYPE_UINT8_EXT : VK_INDEX_TYPE_UINT16, 0);
    maybeByPipeline(random, c, limits);
    return c;
}

// A micromap triangle of the highest level, with some micro-triangles that are unlike their neighbours.
Case highestLevel(Random &random, uint16_t format, uint32_t level)
{
    constexpr uint32_t kSingles = 64;
    Case c{.scene = {.edge = 4e-6f}};
    c.scene.objects.resize(1);
    c.scene.instances = {instanceInPlace(random)};
    oracle::Mesh &mesh = c.scene.objects[0].meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    appendTriangle(mesh.vertices, {});
    mesh.micromap = {.micromap = 0, .indices = {0}};
    oracle::MicromapTriangle triangle = patchyTriangle(random, level, std::max(level, 3u) - 3);
    triangle.format = format;
    const uint8_t values = format == kTwoState ? 2 : 4;
    if (format == kTwoState)
        for (uint8_t &state : triangle.states)
            state &= 1;
    // Half of them where a field of the number's bits ends.
    std::vector<uint32_t> ends = interesting(random, 1u << (2 * level));
    for (uint32_t i = 0; i < kSingles; ++i) {
        uint32_t number = below(random, 1u << (2 * level));
        if (i % 2 == 0 && !ends.empty()) {
            number = ends.back();
            ends.pop_back();
        }
        triangle.states[number] =
            static_cast<uint8_t>((triangle.states[number] + 1 + below(random, values - 1u)) % values);
        const auto [u, v] = microTriangleCentre(number, level);
        for (uint32_t k = 0; k < 2; ++k) {
            Ray &ray = c.scene.rays.emplace_back(rayDown(random));
            ray.origin = {static_cast<float>(u), static_cast<float>(v), 3};
        }
        aimAt(random, c.scene, {}, level, 1);
    }
    c.scene.micromaps.push_back({.triangles = {std::move(triangle)}});
    return c;
}

// Micromaps of the highest level that are copied and serialized.
Case highestCopied(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    Case c = highestLevel(random, kFourState, limits.maxLevel4);
    c.steps = {{.kind = Kind::CloneMicromap}, {.kind = Kind::ReloadMicromap}};
    return c;
}

Case highestCompacted(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    Case c = highestLevel(random, kTwoState, limits.maxLevel2);
    c.scene.micromaps[0].flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    c.steps = {{.kind = Kind::ReloadMicromap}, {.kind = Kind::CompactMicromap}};
    if (limits.serializesMicromaps())
        c.steps.push_back({.kind = Kind::ReloadObject});
    return c;
}

Case highestOnHost(Random &random, const DeviceLimits &limits)
{
    if (!limits.hostCommands)
        return highestLevel(random, kTwoState, limits.maxLevel2);
    Case c = highestCopied(random, limits);
    c.build.micromaps = BuildCommand::Host;
    buildableOnHost(c.scene);
    for (Step &step : c.steps)
        step.host = true;
    return c;
}

// Triangles of the highest levels, lossy where the device has that. Their micro-triangles have the same state within
// each sub-triangle of level 7 (a node), so that a build can lose little by that level; but in three of the nodes, each
// time in another quarter, a few have other states. Rays meet these, of which a lossy build must not overlook any.
Case lossyNodes(Random &random, const DeviceLimits &limits)
{
    constexpr uint32_t kTriangles = 3, kNodeLevel = 7, kMixedNodes = 3, kQuarters = 4;
    Case c{.scene = {.edge = 4e-6f}};
    c.scene.objects.resize(1);
    c.scene.instances = {instanceInPlace(random)};
    oracle::Mesh &mesh = c.scene.objects[0].meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    mesh.micromap = {.micromap = 0};
    oracle::SceneMicromap &micromap = c.scene.micromaps.emplace_back();
    const bool lossy = limits.api == Api::Khr;
    micromap.flags = lossy ? kLossy : 0;
    const uint32_t highest = lossy ? limits.maxLossyLevel : limits.maxLevel4; // at least kRequiredLevel
    for (uint32_t t = 0; t < kTriangles; ++t) {
        const uint32_t level = highest - t, nodeLevel = std::min(kNodeLevel, level - 1);
        const uint32_t nodes = 1u << (2 * nodeLevel), size = 1u << (2 * (level - nodeLevel));
        oracle::MicromapTriangle triangle{.level = level, .format = kFourState};
        for (uint32_t node = 0; node < nodes; ++node)
            triangle.states.insert(triangle.states.end(), size, static_cast<uint8_t>(below(random, 4)));
        const Vec3 place = placeInGrid(t);
        const auto aimAtNumber = [&](uint32_t number) {
            Ray &ray = c.scene.rays.emplace_back(rayDown(random));
            const auto [u, v] = microTriangleCentre(number, level);
            ray.origin = {place[0] + static_cast<float>(u), place[1] + static_cast<float>(v), 3};
        };
        const uint32_t firstQuarter = below(random, kQuarters);
        for (uint32_t i = 0; i < kMixedNodes; ++i) {
            const uint32_t node = below(random, nodes) * size;
            const auto known = static_cast<uint8_t>(below(random, 2));
            std::fill_n(triangle.states.begin() + node, size, known);
            const uint32_t quarter = node + (firstQuarter + i) % kQuarters * (size / kQuarters);
            for (uint32_t k = 1 + below(random, 3); k > 0; --k) {
                const uint32_t other = quarter + below(random, size / kQuarters);
                triangle.states[other] = static_cast<uint8_t>((known + 1 + below(random, 3)) % 4);
                aimAtNumber(other);
                aimAtNumber(node + below(random, size));
            }
        }
        aimAt(random, c.scene, place, level, 24);
        appendTriangle(mesh.vertices, place);
        mesh.micromap->indices.push_back(static_cast<int32_t>(t));
        micromap.triangles.push_back(std::move(triangle));
    }
    return c;
}

// A case of another kind, by a ray tracing pipeline.
template <MakeCase make>
Case byPipeline(Random &random, const DeviceLimits &limits)
{
    Case c = make(random, limits);
    if (limits.pipelines)
        c.trace.method = TracePlan::Method::Pipeline;
    return c;
}

Case someTriangles(Random &random, const DeviceLimits &limits)
{
    return triangles(random, limits, above(random, 1u << 10));
}

Case someInstances(Random &random, const DeviceLimits &limits)
{
    return instances(random, limits, above(random, 1u << 10));
}

Case someMicromapTriangles(Random &random, const DeviceLimits &limits)
{
    return micromapTriangles(random, limits, above(random, 1u << 10));
}

constexpr std::array<MakeCase, 28> kKinds{
    [](Random &random, const DeviceLimits &) { return geometries(random, above(random, 1u << 8)); },
    someTriangles,
    someInstances,
    someMicromapTriangles,
    shortIndices,
    [](Random &random, const DeviceLimits &limits) { return highestLevel(random, kTwoState, limits.maxLevel2); },
    [](Random &random, const DeviceLimits &limits) { return highestLevel(random, kFourState, limits.maxLevel4); },
    [](Random &random, const DeviceLimits &) { return geometries(random, above(random, kManyMore)); },
    [](Random &random, const DeviceLimits &limits) { return triangles(random, limits, above(random, kManyMore)); },
    [](Random &random, const DeviceLimits &limits) { return instances(random, limits, above(random, kManyMore)); },
    [](Random &random, const DeviceLimits &limits) {
        return micromapTriangles(random, limits, above(random, kManyMore));
    },
    byPipeline<someTriangles>,
    byPipeline<someInstances>,
    byPipeline<someMicromapTriangles>,
    byPipeline<shortIndices>,
    highestCopied,
    highestCompacted,
    highestOnHost,
    lossyNodes,
    [](Random &random, const DeviceLimits &limits) { return sharedData(random, limits, above(random, 1u << 15)); },
    [](Random &random, const DeviceLimits &limits) { return sharedData(random, limits, above(random, 1u << 10)); },
    manyRecords,
    movedData<false>,
    movedData<true>,
    copiedTriangles,
    updatedTriangles<false>,
    updatedTriangles<true>,
    updatedInstances,
};

Outcome scale(Session &session, std::string_view group, uint64_t seed)
{
    return runRandomCase(session, group, seed, kKinds[seed % kKinds.size()]);
}

constexpr std::array kScaleGroups{
    Group{"scale",
          "more than 256 and 65,536 geometries, triangles, instances and micromap triangles; indices with the highest "
          "bit set; the highest levels, also lossy, copied and serialized; strides of triangle arrays and data of more "
          "than 64 KiB; more than 1,024 and 32,768 triangles that are compacted, with equal data far apart; more than "
          "512 whose data has gaps, or whose build is lossy; copies and updates of more than 1,024 triangles and "
          "instances; hit tables of megabytes",
          "maxGeometryCount, maxPrimitiveCount, maxInstanceCount, maxMicromapTriangles; "
          "VkAccelerationStructureTrianglesOpacityMicromapKHR: indexType, baseTriangle; "
          "maxOpacity2StateSubdivisionLevel, maxOpacity4StateSubdivisionLevel and "
          "maxOpacityLossy4StateSubdivisionLevel",
          80, scale, kKinds.size(), kKinds.size()},
};

} // namespace

std::span<const Group> scaleGroups()
{
    return kScaleGroups;
}

} // namespace vellum::check
