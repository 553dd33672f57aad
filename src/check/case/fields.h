// SPDX-License-Identifier: Apache-2.0
// The fields of a case, listed once for all that reads or writes them. An archive has these functions, each with a
// field's name and the field:
//   value (a default), name (a table, a default), bits (a table), floats, states: one value
//   vectors, indices: lists of numbers; names (a table): a list of names
//   object, list: a structure that `of` lists the fields of, or a list of them
//   optional: std::optional of a structure
#pragma once

#include <type_traits>

#include "check/case/names.h"

namespace vellum::check::fields
{

// The structure, const or not.
template <class T, class Structure>
concept Is = std::is_same_v<std::remove_const_t<T>, Structure>;

// Names all fields of a structure to an archive, in the order in which they are written.
template <class Archive, Is<oracle::MicromapTriangle> T>
void of(Archive &archive, T &triangle)
{
    archive.always("level", triangle.level);
    archive.name("format", triangle.format, kFormatNames);
    archive.states("states", triangle.states);
}

template <class Archive, Is<oracle::SceneMicromap> T>
void of(Archive &archive, T &micromap)
{
    archive.bits("flags", micromap.flags, kMicromapFlagNames);
    archive.value("triangleStride", micromap.triangleStride, uint32_t{sizeof(VkMicromapTriangleEXT)});
    archive.value("usagePointers", micromap.usagePointers, false);
    archive.bits("usage", micromap.usage, kUsageNames);
    archive.bits("layout", micromap.layout, kDataNames);
    archive.value("onHost", micromap.onHost, false);
    archive.list("triangles", micromap.triangles);
}

template <class Archive, Is<oracle::MeshMicromap> T>
void of(Archive &archive, T &use)
{
    archive.value("micromap", use.micromap, std::optional<uint32_t>());
    archive.name("indexType", use.indexType, kIndexTypeNames);
    archive.indices("indices", use.indices);
    archive.value("base", use.base, 0u);
    archive.value("stride", use.stride, std::optional<uint32_t>());
    archive.value("indexOffset", use.indexOffset, 0u);
    archive.value("usagePointers", use.usagePointers, false);
    archive.bits("usage", use.usage, kUsageNames);
}

template <class Archive, Is<VkTransformMatrixKHR> T>
void of(Archive &archive, T &transform)
{
    archive.vectors("matrix", transform.matrix);
}

template <class Archive, Is<oracle::MeshLayout> T>
void of(Archive &archive, T &layout)
{
    archive.name("vertexFormat", layout.vertexFormat, kVertexFormatNames, VK_FORMAT_R32G32B32_SFLOAT);
    archive.value("stride", layout.stride, 0u);
    archive.value("primitiveOffset", layout.primitiveOffset, 0u);
    archive.value("firstVertex", layout.firstVertex, 0u);
    archive.name("indexType", layout.indexType, kIndexTypeNames, VK_INDEX_TYPE_NONE_KHR);
    archive.value("firstIndex", layout.firstIndex, 0u);
    archive.value("separate", layout.separate, false);
    archive.value("order", layout.order, 0u);
    archive.optional("transform", layout.transform);
    archive.value("transformOffset", layout.transformOffset, 0u);
}

template <class Archive, Is<oracle::Mesh> T>
void of(Archive &archive, T &mesh)
{
    archive.value("opaque", mesh.opaque, false);
    archive.value("noDuplicates", mesh.noDuplicates, false);
    archive.vectors("vertices", mesh.vertices);
    archive.vectors("boxes", mesh.boxes);
    archive.object("layout", mesh.layout);
    archive.optional("micromap", mesh.micromap);
}

template <class Archive, Is<oracle::Object> T>
void of(Archive &archive, T &object)
{
    archive.bits("flags", object.flags, kStructureFlagNames);
    archive.value("geometryPointers", object.geometryPointers, false);
    archive.list("meshes", object.meshes);
}

template <class Archive, Is<oracle::Instance> T>
void of(Archive &archive, T &instance)
{
    archive.always("object", instance.object);
    archive.vectors("transform", instance.transform.matrix);
    archive.value("customIndex", instance.customIndex, 0u);
    archive.value("mask", instance.mask, 0xffu);
    archive.bits("flags", instance.flags, kInstanceFlagNames);
    archive.value("inactive", instance.inactive, false);
    archive.value("record", instance.record, std::optional<uint32_t>());
}

template <class Archive, Is<Ray> T>
void of(Archive &archive, T &ray)
{
    const Ray standard;
    archive.floats("origin", ray.origin);
    archive.floats("direction", ray.direction);
    archive.value("tMin", ray.tMin, standard.tMin);
    archive.value("tMax", ray.tMax, standard.tMax);
    archive.bits("flags", ray.flags, kRayFlagNames);
    archive.value("cullMask", ray.cullMask, standard.cullMask);
    archive.name("rule", ray.rule, kRuleNames, standard.rule);
    archive.value("generate", ray.generate, standard.generate);
}

template <class Archive, Is<oracle::Scene> T>
void of(Archive &archive, T &scene)
{
    archive.bits("topFlags", scene.topFlags, kStructureFlagNames);
    archive.value("edge", scene.edge, std::decay_t<T>().edge);
    archive.list("micromaps", scene.micromaps);
    archive.list("objects", scene.objects);
    archive.list("instances", scene.instances);
    archive.list("rays", scene.rays);
}

template <class Archive, Is<BuildPlan> T>
void of(Archive &archive, T &build)
{
    const BuildPlan standard;
    archive.name("micromaps", build.micromaps, kBuildCommandNames, standard.micromaps);
    archive.name("structures", build.structures, kBuildCommandNames, standard.structures);
    archive.value("together", build.together, standard.together);
    archive.value("deferred", build.deferred, standard.deferred);
    archive.value("mixed", build.mixed, standard.mixed);
    archive.value("threads", build.threads, standard.threads);
    archive.value("instancePointers", build.instancePointers, standard.instancePointers);
    archive.value("geometryPointers", build.geometryPointers, standard.geometryPointers);
    archive.value("single", build.single, standard.single);
    archive.name("conditional", build.conditional, kConditionalNames, standard.conditional);
    archive.value("spareTriangles", build.spareTriangles, standard.spareTriangles);
    archive.value("spareInstances", build.spareInstances, standard.spareInstances);
    archive.value("skippedInstances", build.skippedInstances, standard.skippedInstances);
    archive.value("secondary", build.secondary, standard.secondary);
    archive.value("twice", build.twice, standard.twice);
    archive.value("unrelated", build.unrelated, standard.unrelated);
    archive.value("otherTop", build.otherTop, standard.otherTop);
    archive.value("sharedInputs", build.sharedInputs, standard.sharedInputs);
    archive.value("aliasedInputs", build.aliasedInputs, standard.aliasedInputs);
    archive.value("lateInputs", build.lateInputs, standard.lateInputs);
    archive.value("rerecorded", build.rerecorded, standard.rerecorded);
    archive.value("backwards", build.backwards, standard.backwards);
    archive.value("secondDevice", build.secondDevice, standard.secondDevice);
    archive.value("anotherThread", build.anotherThread, standard.anotherThread);
}

template <class Archive, Is<Step> T>
void of(Archive &archive, T &step)
{
    archive.name("kind", step.kind, kStepNames);
    archive.value("target", step.target, 0u);
    archive.value("other", step.other, 0u);
    archive.value("update", step.update, false);
    archive.value("outOfPlace", step.outOfPlace, false);
    archive.value("relocated", step.relocated, false);
    archive.value("structureFirst", step.structureFirst, false);
    archive.value("mirrored", step.mirrored, false);
    archive.value("exact", step.exact, false);
    archive.value("inPlace", step.inPlace, false);
    archive.value("host", step.host, false);
    archive.value("deferred", step.deferred, false);
    archive.list("states", step.states);
    archive.optional("micromapUse", step.micromapUse);
    archive.list("instances", step.instances);
}

template <class Archive, Is<PipelinePart> T>
void of(Archive &archive, T &part)
{
    archive.names("stages", part.stages, kTracerStageNames);
    archive.names("groups", part.groups, kTracerGroupNames);
    archive.indices("libraries", part.libraries);
    archive.value("micromapBit", part.micromapBit, false);
}

template <class Archive, Is<oracle::TablePlan> T>
void of(Archive &archive, T &table)
{
    const oracle::TablePlan standard;
    archive.names("records", table.records, kHitRecordNames);
    archive.value("length", table.length, std::optional<uint32_t>());
    archive.value("misses", table.misses, standard.misses);
    archive.value("nullMiss", table.nullMiss, false);
    archive.name("content", table.content, kRecordDataNames, standard.content);
    archive.value("zeroData", table.zeroData, std::optional<uint32_t>());
    archive.value("before", table.layout.before, 0u);
    archive.value("reversed", table.layout.reversed, false);
    archive.value("missPadding", table.layout.missPadding, 0u);
    archive.value("hitPadding", table.layout.hitPadding, 0u);
    archive.value("zeroStride", table.layout.zeroStride, false);
    archive.value("cut", table.layout.cut, false);
    archive.value("otherStride", table.layout.otherStride, false);
}

template <class Archive, Is<PipelinePlan> T>
void of(Archive &archive, T &pipeline)
{
    const PipelinePlan standard;
    archive.list("parts", pipeline.parts);
    archive.bits("flags", pipeline.flags, kPipelineFlagNames);
    archive.value("recordOffset", pipeline.parameters.recordOffset, standard.parameters.recordOffset);
    archive.value("recordStride", pipeline.parameters.recordStride, standard.parameters.recordStride);
    archive.value("missIndex", pipeline.parameters.missIndex, standard.parameters.missIndex);
    archive.object("table", pipeline.table);
    archive.list("otherTables", pipeline.otherTables);
}

template <class Archive, Is<QueryTarget> T>
void of(Archive &archive, T &target)
{
    archive.name("of", target.of, kQueryTargetNames);
    archive.value("number", target.number, 0u);
}

template <class Archive, Is<QueryCommand> T>
void of(Archive &archive, T &command)
{
    archive.name("kind", command.kind, kQueryCommandNames);
    archive.value("first", command.first, 0u);
    archive.value("count", command.count, 1u);
    archive.list("targets", command.targets);
    archive.value("wide", command.wide, false);
    archive.value("availability", command.availability, false);
    archive.value("wait", command.wait, false);
    archive.value("partial", command.partial, false);
    archive.value("byAddress", command.byAddress, false);
    archive.value("offset", command.offset, 0u);
    archive.value("padding", command.padding, 0u);
}

template <class Archive, Is<QueryPlan> T>
void of(Archive &archive, T &plan)
{
    archive.name("property", plan.property, kPropertyNames);
    archive.value("count", plan.count, 1u);
    archive.list("commands", plan.commands);
}

template <class Archive, Is<AddressRegion> T>
void of(Archive &archive, T &region)
{
    const AddressRegion standard;
    archive.value("buffer", region.buffer, standard.buffer);
    archive.value("offset", region.offset, standard.offset);
    archive.value("size", region.size, standard.size);
    archive.value("spare", region.spare, standard.spare);
    archive.value("from", region.from, standard.from);
    archive.value("fromOffset", region.fromOffset, standard.fromOffset);
    archive.value("level", region.level, standard.level);
    archive.value("layer", region.layer, standard.layer);
    archive.value("layers", region.layers, standard.layers);
    archive.value("x", region.x, standard.x);
    archive.value("y", region.y, standard.y);
    archive.value("z", region.z, standard.z);
    archive.value("width", region.width, standard.width);
    archive.value("height", region.height, standard.height);
    archive.value("depth", region.depth, standard.depth);
    archive.value("rowLength", region.rowLength, standard.rowLength);
    archive.value("imageHeight", region.imageHeight, standard.imageHeight);
}

template <class Archive, Is<AddressCommand> T>
void of(Archive &archive, T &command)
{
    archive.name("command", command.kind, kAddressCommandNames);
    archive.list("regions", command.regions);
    archive.value("value", command.value, 0u);
    archive.value("fullyBound", command.fullyBound, false);
}

template <class Archive, Is<AddressPlan> T>
void of(Archive &archive, T &plan)
{
    const AddressPlan standard;
    archive.indices("buffers", plan.buffers);
    archive.name("format", plan.format, kImageFormatNames, standard.format);
    archive.value("volume", plan.volume, standard.volume);
    archive.value("width", plan.width, standard.width);
    archive.value("height", plan.height, standard.height);
    archive.value("depth", plan.depth, standard.depth);
    archive.value("levels", plan.levels, standard.levels);
    archive.value("layers", plan.layers, standard.layers);
    archive.value("optimal", plan.optimal, standard.optimal);
    archive.list("commands", plan.commands);
}

template <class Archive, Is<TracePlan> T>
void of(Archive &archive, T &trace)
{
    const TracePlan standard;
    archive.name("method", trace.method, kMethodNames, standard.method);
    archive.name("stage", trace.stage, kStageNames, standard.stage);
    archive.name("flags", trace.flags, kFlagSourceNames, standard.flags);
    archive.name("mode", trace.mode, kModeNames, standard.mode);
    archive.value("byAddress", trace.byAddress, standard.byAddress);
    archive.value("inlineModules", trace.inlineModules, standard.inlineModules);
    archive.value("secondary", trace.secondary, standard.secondary);
    archive.value("besideBuild", trace.besideBuild, standard.besideBuild);
    archive.value("boundFirst", trace.boundFirst, standard.boundFirst);
    archive.value("pipelineLast", trace.pipelineLast, standard.pipelineLast);
    archive.value("maintenance6", trace.maintenance6, standard.maintenance6);
    archive.value("twice", trace.twice, standard.twice);
    archive.value("rerecorded", trace.rerecorded, standard.rerecorded);
    archive.name("query", trace.query, kQueryNames, standard.query);
    archive.value("optimized", trace.optimized, standard.optimized);
    archive.value("signedFlags", trace.signedFlags, standard.signedFlags);
    archive.name("otherEntry", trace.otherEntry, kOtherEntryNames, standard.otherEntry);
    archive.value("shaderObjects", trace.shaderObjects, standard.shaderObjects);
    archive.value("rebound", trace.rebound, standard.rebound);
    archive.value("vertexBuffers", trace.vertexBuffers, standard.vertexBuffers);
    archive.value("dynamicStrides", trace.dynamicStrides, standard.dynamicStrides);
    archive.object("pipeline", trace.pipeline);
    archive.list("otherPipelines", trace.otherPipelines);
    archive.value("tablesInPlace", trace.tablesInPlace, standard.tablesInPlace);
    archive.bits("tableBarrier", trace.tableBarrier, kTableBarrierNames);
    archive.value("firstDestroyed", trace.firstDestroyed, standard.firstDestroyed);
    archive.value("dynamicStackSize", trace.dynamicStackSize, standard.dynamicStackSize);
    archive.name("from", trace.from, kFromNames, standard.from);
    archive.value("flags2", trace.flags2, standard.flags2);
    archive.bits("chained", trace.chained, kChainedNames);
    archive.value("unusedStage", trace.unusedStage, standard.unusedStage);
    archive.name("launch", trace.launch.command, kLaunchNames, standard.launch.command);
    archive.value("height", trace.launch.height, standard.launch.height);
    archive.value("depth", trace.launch.depth, standard.launch.depth);
    archive.value("commandOffset", trace.launch.offset, standard.launch.offset);
    archive.value("counted", trace.launch.counted, standard.launch.counted);
    archive.name("attributes", trace.attributes, kAttributeNames, standard.attributes);
    archive.bits("creation", trace.creation, kCreationNames);
    archive.value("callables", trace.callables, standard.callables);
    archive.value("withoutMicromaps", trace.withoutMicromaps, standard.withoutMicromaps);
}

template <class Archive, Is<Case> T>
void of(Archive &archive, T &c)
{
    archive.value("group", c.group, std::string());
    archive.value("seed", c.seed, uint64_t{0});
    archive.name("memory", c.memory, kMemoryNames, Memory::Apart);
    archive.object("scene", c.scene);
    archive.object("build", c.build);
    archive.list("steps", c.steps);
    archive.list("queries", c.queries);
    archive.object("addressCopies", c.addressCopies);
    archive.object("trace", c.trace);
}

// An archive that hands the name of each field of a plan, and the field, to a function.
template <class Visit>
struct EachField {
    Visit visit;

    void value(std::string_view name, auto &field, const auto &...) { visit(name, field); }
    void name(std::string_view name, auto &field, const auto &...) { visit(name, field); }
    void bits(std::string_view name, auto &field, const auto &) { visit(name, field); }
    void object(std::string_view name, auto &field) { visit(name, field); }
    void list(std::string_view name, auto &field) { visit(name, field); }
};

// The addresses of all fields of a structure, in their order.
template <class Structure>
std::vector<const void *> all(const Structure &structure)
{
    std::vector<const void *> fields;
    EachField list{[&](std::string_view, const auto &field) { fields.push_back(&field); }};
    of(list, structure);
    return fields;
}

} // namespace vellum::check::fields
