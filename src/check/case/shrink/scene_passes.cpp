// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <span>

#include "check/case/case.h"
#include "check/case/names.h"
#include "check/case/shrink/passes.h"
#include "check/case/shrink/removal.h"

namespace vellum::check
{
namespace
{

using Kind = Step::Kind;

constexpr VkTransformMatrixKHR kIdentity{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

// The ray as the object of the instance sees it, in double precision.
Ray inObject(const Ray &ray, const VkTransformMatrixKHR &transform)
{
    const auto m = [&](size_t row, size_t column) { return double{transform.matrix[row % 3][column % 3]}; };
    const auto cofactor = [&](size_t row, size_t column) {
        return m(row + 1, column + 1) * m(row + 2, column + 2) - m(row + 1, column + 2) * m(row + 2, column + 1);
    };
    const double determinant = m(0, 0) * cofactor(0, 0) + m(0, 1) * cofactor(0, 1) + m(0, 2) * cofactor(0, 2);
    Ray out = ray;
    for (size_t column = 0; column < 3; ++column) {
        double origin = 0, direction = 0;
        for (size_t row = 0; row < 3; ++row) {
            origin += cofactor(row, column) * (double{ray.origin[row]} - double{transform.matrix[row][3]});
            direction += cofactor(row, column) * double{ray.direction[row]};
        }
        out.origin[column] = static_cast<float>(origin / determinant);
        out.direction[column] = static_cast<float>(direction / determinant);
    }
    return out;
}

// A change of an instance, in the scene and where a step has others.
Edit ofInstance(size_t i, const std::function<void(oracle::Instance &)> &change)
{
    return [i, change](Case &c) {
        forEachInstances(c, [&](std::vector<oracle::Instance> &instances) {
            if (i < instances.size())
                change(instances[i]);
        });
    };
}

void simplifyTransforms(Attempts &attempts)
{
    const std::vector<oracle::Instance> &instances = attempts.best().scene.instances;
    std::vector<Edit> translations, identities;
    for (size_t i = 0; i < instances.size(); ++i) {
        identities.push_back(ofInstance(i, [](oracle::Instance &instance) { instance.transform = kIdentity; }));
        translations.push_back(ofInstance(i, [](oracle::Instance &instance) {
            for (size_t row = 0; row < 3; ++row)
                for (size_t column = 0; column < 3; ++column)
                    instance.transform.matrix[row][column] = row == column ? 1.0f : 0.0f;
        }));
    }
    attempts.attemptAll(identities);
    if (instances.size() == 1) {
        attempts.attempt([](Case &c) {
            for (Ray &ray : c.scene.rays)
                ray = inObject(ray, c.scene.instances[0].transform);
            c.scene.instances[0].transform = kIdentity;
        });
    }
    attempts.attemptAll(translations);
}

void simplifyInstances(Attempts &attempts)
{
    std::vector<Edit> edits;
    const std::vector<oracle::Instance> &instances = attempts.best().scene.instances;
    for (size_t i = 0; i < instances.size(); ++i) {
        edits.push_back(ofInstance(i, [](oracle::Instance &instance) { instance.customIndex = 0; }));
        edits.push_back(ofInstance(i, [](oracle::Instance &instance) { instance.mask = 0xff; }));
        edits.push_back(ofInstance(i, [](oracle::Instance &instance) { instance.inactive = false; }));
        edits.push_back(ofInstance(i, [](oracle::Instance &instance) { instance.record.reset(); }));
        for (const Bit &bit : kInstanceFlagNames)
            edits.push_back(ofInstance(i, [bit = bit.value](oracle::Instance &instance) { instance.flags &= ~bit; }));
    }
    const std::vector<oracle::Object> &objects = attempts.best().scene.objects;
    for (size_t o = 0; o < objects.size(); ++o) {
        edits.emplace_back([o](Case &c) { c.scene.objects[o].geometryPointers = false; });
        for (size_t m = 0; m < objects[o].meshes.size(); ++m) {
            edits.emplace_back([o, m](Case &c) { c.scene.objects[o].meshes[m].opaque = false; });
            edits.emplace_back([o, m](Case &c) { c.scene.objects[o].meshes[m].noDuplicates = false; });
            // Active, where it was not.
            edits.emplace_back([o, m](Case &c) {
                for (Vec3 &vertex : c.scene.objects[o].meshes[m].vertices)
                    vertex[0] = std::isnan(vertex[0]) ? 0 : vertex[0];
            });
        }
    }
    attempts.attemptAll(edits);
}

using EditMesh = std::function<void(oracle::Mesh &)>;

// An edit for each mesh, made separately.
std::vector<Edit> editsOfMeshes(const Case &best, const EditMesh &edit)
{
    std::vector<Edit> edits;
    for (size_t o = 0; o < best.scene.objects.size(); ++o)
        for (size_t m = 0; m < best.scene.objects[o].meshes.size(); ++m)
            edits.emplace_back([o, m, edit](Case &c) { edit(c.scene.objects[o].meshes[m]); });
    return edits;
}

// After a change of the vertex format or of the indices, removes a stride and an offset that do not fit.
void fitLayout(oracle::MeshLayout &layout)
{
    const VertexFormat format = vertexFormat(layout.vertexFormat);
    if (layout.stride < format.bytes || layout.stride % format.alignment != 0)
        layout.stride = 0;
    layout.primitiveOffset -= layout.primitiveOffset % 4;
}

// Keeps the triangles, and removes the transform or replaces it by one that does nothing.
void applyTransform(oracle::Mesh &mesh, bool keep)
{
    if (!mesh.layout.transform)
        return;
    for (uint32_t t = 0; t < mesh.triangles(); ++t) {
        const oracle::Corners corners = oracle::cornersOf(mesh, t);
        for (size_t k = 0; k < 3; ++k) {
            Vec3 &vertex = mesh.vertices[size_t{3} * t + k];
            for (size_t i = 0; i < 3 && !std::isnan(corners[k][0]); ++i)
                vertex[i] = static_cast<float>(corners[k][i]);
        }
    }
    mesh.layout.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    mesh.layout.transform = keep ? std::optional(kIdentity) : std::nullopt;
    mesh.layout.transformOffset = keep ? mesh.layout.transformOffset : 0;
    fitLayout(mesh.layout);
}

// Meshes that lie in memory as plainly as can be.
void simplifyLayouts(Attempts &attempts)
{
    const auto attempt = [&](const EditMesh &edit) { attempts.attemptAll(editsOfMeshes(attempts.best(), edit)); };
    attempt([](oracle::Mesh &mesh) {
        applyTransform(mesh, false);
        mesh.layout = {};
    });
    attempt([](oracle::Mesh &mesh) { applyTransform(mesh, false); });
    attempt([](oracle::Mesh &mesh) { applyTransform(mesh, true); });
    attempt([](oracle::Mesh &mesh) { // elsewhere, in a format that has no other values
        mesh.layout.transform.reset();
        mesh.layout.transformOffset = 0;
    });
    attempt([](oracle::Mesh &mesh) {
        mesh.layout.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
        fitLayout(mesh.layout);
    });
    attempt([](oracle::Mesh &mesh) {
        mesh.layout.indexType = VK_INDEX_TYPE_NONE_KHR;
        mesh.layout.firstIndex = mesh.layout.order = 0;
        mesh.layout.separate = false;
        fitLayout(mesh.layout);
    });
    attempt([](oracle::Mesh &mesh) {
        mesh.layout.indexType = mesh.layout.isIndexed() ? VK_INDEX_TYPE_UINT32 : mesh.layout.indexType;
    });
    attempt([](oracle::Mesh &mesh) { mesh.layout.separate = false; });
    for (uint32_t oracle::MeshLayout::*const number :
         {&oracle::MeshLayout::stride, &oracle::MeshLayout::primitiveOffset, &oracle::MeshLayout::firstVertex,
          &oracle::MeshLayout::firstIndex, &oracle::MeshLayout::order, &oracle::MeshLayout::transformOffset})
        attempt([number](oracle::Mesh &mesh) { mesh.layout.*number = 0; });
}

void simplifyRays(Attempts &attempts)
{
    std::vector<Edit> edits;
    // All at once, as they must be where they are specialized.
    for (uint32_t bit = 1; bit != 0; bit <<= 1)
        edits.emplace_back([bit](Case &c) {
            for (Ray &ray : c.scene.rays)
                ray.flags &= ~bit;
        });
    const std::vector<Ray> &rays = attempts.best().scene.rays;
    for (size_t i = 0; i < rays.size(); ++i) {
        edits.emplace_back([i](Case &c) { c.scene.rays[i].generate = 0; });
        edits.emplace_back([i](Case &c) { c.scene.rays[i].tMin = Ray().tMin; });
        edits.emplace_back([i](Case &c) { c.scene.rays[i].tMax = Ray().tMax; });
        edits.emplace_back([i](Case &c) { c.scene.rays[i].cullMask = Ray().cullMask; });
        edits.emplace_back([i](Case &c) { c.scene.rays[i].rule = Ray().rule; });
        for (uint32_t bit = 1; bit != 0 && rays.size() > 1; bit <<= 1)
            if ((rays[i].flags & bit) != 0)
                edits.emplace_back([i, bit](Case &c) { c.scene.rays[i].flags &= ~bit; });
    }
    attempts.attemptAll(edits);
}

void roundTo(std::span<float> values, float steps)
{
    for (float &value : values)
        value = std::round(value * steps) / steps + 0.0f; // no -0
}

// Coordinates with few digits.
void roundCoordinates(Attempts &attempts)
{
    constexpr uint32_t kMostRounded = 64; // triangles of a mesh
    for (const float steps : {1.0f, 10.0f, 100.0f, 1000.0f}) {
        std::vector<Edit> edits;
        const oracle::Scene &scene = attempts.best().scene;
        for (size_t o = 0; o < scene.objects.size(); ++o)
            for (size_t m = 0; m < scene.objects[o].meshes.size(); ++m) {
                // Vertices of a grid are a few runs, as long as they are not rounded.
                if (scene.objects[o].meshes[m].triangles() > kMostRounded)
                    continue;
                edits.emplace_back([o, m, steps](Case &c) {
                    for (Vec3 &vertex : c.scene.objects[o].meshes[m].vertices) {
                        roundTo(vertex, steps);
                        vertex = quantized(c.scene.objects[o].meshes[m].layout.vertexFormat, vertex);
                    }
                    if (auto &transform = c.scene.objects[o].meshes[m].layout.transform)
                        roundTo(std::span(&transform->matrix[0][0], 12), steps);
                    for (VkAabbPositionsKHR &box : c.scene.objects[o].meshes[m].boxes)
                        for (float *value : {&box.minX, &box.minY, &box.minZ, &box.maxX, &box.maxY, &box.maxZ})
                            roundTo(std::span(value, 1), steps);
                });
            }
        for (size_t i = 0; i < scene.instances.size(); ++i)
            edits.push_back(ofInstance(i, [steps](oracle::Instance &instance) {
                roundTo(std::span(&instance.transform.matrix[0][0], 12), steps);
            }));
        for (size_t i = 0; i < scene.rays.size(); ++i) {
            edits.emplace_back([i, steps](Case &c) { roundTo(c.scene.rays[i].origin, steps); });
            edits.emplace_back([i, steps](Case &c) { roundTo(c.scene.rays[i].direction, steps); });
            edits.emplace_back([i, steps](Case &c) {
                Ray &ray = c.scene.rays[i];
                for (float *value : {&ray.tMin, &ray.tMax, &ray.generate})
                    roundTo(std::span(value, 1), steps);
            });
        }
        attempts.attemptAll(edits);
    }
}

PipelinePlan &pipelineOf(Case &c, size_t i)
{
    return i == 0 ? c.trace.pipeline : c.trace.otherPipelines[i - 1];
}

oracle::TablePlan &tableOf(PipelinePlan &pipeline, size_t i)
{
    return i == 0 ? pipeline.table : pipeline.otherTables[i - 1];
}

// Puts a library's stages and groups into what links it.
void mergePart(std::vector<PipelinePart> &parts, size_t at)
{
    const PipelinePart library = parts[at];
    const auto number = static_cast<uint32_t>(at);
    for (PipelinePart &part : parts) {
        const auto found = std::ranges::find(part.libraries, number);
        if (found == part.libraries.end())
            continue;
        part.libraries.insert(part.libraries.erase(found), library.libraries.begin(), library.libraries.end());
        part.groups.insert(part.groups.end(), library.groups.begin(), library.groups.end());
        for (const uint32_t stage : library.stages)
            if (std::ranges::find(part.stages, stage) == part.stages.end())
                part.stages.push_back(stage);
    }
    parts.erase(parts.begin() + static_cast<ptrdiff_t>(at));
    for (PipelinePart &part : parts)
        for (uint32_t &other : part.libraries)
            other -= other > number ? 1 : 0;
}

// Fewer pipelines, tables and libraries, and each like the plain one.
void simplifyPipelines(Attempts &attempts)
{
    using oracle::TablePlan;
    for (size_t i = attempts.best().trace.otherPipelines.size(); i > 0; --i) {
        // Tries without the pipeline before it, then without this one.
        if (!attempts.attempt([i](Case &c) {
                pipelineOf(c, i - 1) = c.trace.otherPipelines[i - 1];
                c.trace.otherPipelines.erase(c.trace.otherPipelines.begin() + static_cast<ptrdiff_t>(i - 1));
                c.trace.firstDestroyed &= !c.trace.otherPipelines.empty();
            }))
            attempts.attempt([i](Case &c) {
                c.trace.otherPipelines.erase(c.trace.otherPipelines.begin() + static_cast<ptrdiff_t>(i - 1));
                c.trace.firstDestroyed &= !c.trace.otherPipelines.empty();
            });
    }
    for (size_t p = 0; p <= attempts.best().trace.otherPipelines.size(); ++p) {
        const auto pipeline = [&] {
            Case best = attempts.best();
            return pipelineOf(best, p);
        };
        const auto edit = [&](const std::function<void(PipelinePlan &)> &change) {
            attempts.attempt([&](Case &c) { change(pipelineOf(c, p)); });
        };
        for (size_t t = pipeline().otherTables.size(); t > 0; --t) {
            edit([t](PipelinePlan &plan) {
                tableOf(plan, t - 1) = plan.otherTables[t - 1];
                plan.otherTables.erase(plan.otherTables.begin() + static_cast<ptrdiff_t>(t - 1));
            });
            if (t <= pipeline().otherTables.size())
                edit([t](PipelinePlan &plan) {
                    plan.otherTables.erase(plan.otherTables.begin() + static_cast<ptrdiff_t>(t - 1));
                });
        }
        edit([](PipelinePlan &plan) { plan.parts.clear(); });
        for (size_t i = pipeline().parts.size(); i > 1; --i)
            edit([i](PipelinePlan &plan) {
                if (i <= plan.parts.size())
                    mergePart(plan.parts, i - 2);
            });
        for (size_t i = 0; i < pipeline().parts.size(); ++i)
            for (size_t k = pipeline().parts[i].stages.size(); k > 0; --k)
                edit([i, k](PipelinePlan &plan) {
                    std::vector<uint32_t> &stages = plan.parts[i].stages;
                    stages.erase(stages.begin() + static_cast<ptrdiff_t>(k - 1));
                });
        for (const Bit &bit : kPipelineFlagNames)
            edit([bit = bit.value](PipelinePlan &plan) { plan.flags &= ~bit; });
        edit([](PipelinePlan &plan) { plan.parameters.recordOffset = 0; });
        edit([](PipelinePlan &plan) { plan.parameters.recordStride = 1; });
        edit([](PipelinePlan &plan) { plan.parameters.missIndex = 0; });
        for (size_t t = 0; t <= pipeline().otherTables.size(); ++t) {
            const auto editTable = [&](const std::function<void(TablePlan &)> &change) {
                edit([&](PipelinePlan &plan) { change(tableOf(plan, t)); });
            };
            editTable([](TablePlan &table) { table.records = {oracle::HitRecord::Full}; });
            editTable([](TablePlan &table) { table.length.reset(); });
            editTable([](TablePlan &table) { table.misses = 1; });
            editTable([](TablePlan &table) { table.nullMiss = false; });
            editTable([](TablePlan &table) { table.content = RecordData::Word; });
            editTable([](TablePlan &table) { table.layout = {}; });
            for (const auto member : {&TableLayout::before, &TableLayout::missPadding, &TableLayout::hitPadding})
                editTable([member](TablePlan &table) { table.layout.*member = 0; });
            for (const auto member : {&TableLayout::reversed, &TableLayout::zeroStride, &TableLayout::cut})
                editTable([member](TablePlan &table) { table.layout.*member = false; });
        }
    }
}

// The simpler kinds that can replace a step; the kind itself if there is none.
std::vector<Kind> simplerThan(Kind kind)
{
    switch (kind) {
    case Kind::UpdateObject: return {Kind::CloneObject, Kind::RebuildObject};
    case Kind::ReplaceObject:
    case Kind::RebuildObjects: return {Kind::RebuildObject};
    case Kind::CompactObject:
    case Kind::ReloadObject:
    case Kind::RebuildObject:
    case Kind::MoveObject:
    case Kind::RenameObject: return {Kind::CloneObject};
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap: return {Kind::CloneMicromap};
    case Kind::CompactTop:
    case Kind::ReloadTop:
    case Kind::UpdateTop:
    case Kind::RebuildTop: return {Kind::CloneTop};
    default: return {};
    }
}

} // namespace

void simplifyScene(Attempts &attempts)
{
    simplifyInstances(attempts);
    simplifyLayouts(attempts);
    simplifyRays(attempts);
    simplifyTransforms(attempts);
    roundCoordinates(attempts);
}

// Adds edits that make a command of a query plan simpler.
void addQueryEdits(size_t plan, size_t command, std::vector<Edit> &edits)
{
    const auto add = [&](const std::function<void(QueryCommand &)> &change) {
        edits.emplace_back([=](Case &c) { change(c.queries[plan].commands[command]); });
    };
    for (bool QueryCommand::*const flag : {&QueryCommand::byAddress, &QueryCommand::partial, &QueryCommand::wait,
                                           &QueryCommand::availability, &QueryCommand::wide})
        add([flag](QueryCommand &of) { of.*flag = false; });
    for (uint32_t QueryCommand::*const number : {&QueryCommand::offset, &QueryCommand::padding})
        add([number](QueryCommand &of) { of.*number = 0; });
    add([](QueryCommand &of) {
        if (of.kind == QueryCommand::Kind::ResetOnHost)
            of.kind = QueryCommand::Kind::Reset;
    });
}

void simplifyPlans(Attempts &attempts)
{
    simplifyPipelines(attempts);
    std::vector<Edit> edits{
        [](Case &c) { c.memory = Memory::Apart; },
        [](Case &c) { c.build.micromaps = BuildCommand::Device; },
        [](Case &c) { c.build.structures = BuildCommand::Device; },
        [](Case &c) { c.build.mixed = false; },
        [](Case &c) { c.build.together = c.build.mixed = false; },
        [](Case &c) { c.build.threads = 1; },
        [](Case &c) { c.build.instancePointers = false; },
        [](Case &c) { c.build.geometryPointers = false; },
        [](Case &c) { c.build.single = false; },
        [](Case &c) { c.build.conditional = Conditional::None; },
        [](Case &c) {
            if (c.build.conditional != Conditional::None)
                c.build.conditional = Conditional::False;
        },
        [](Case &c) { c.build.spareTriangles = 0; },
        [](Case &c) { c.build.spareInstances = 0; },
        [](Case &c) { c.build.skippedInstances = 0; },
        [](Case &c) { c.build.otherTop = false; },
        [](Case &c) { c.build.unrelated = false; },
        [](Case &c) { c.build.secondary = false; },
        [](Case &c) { c.build.twice = false; },
        [](Case &c) { c.build.sharedInputs = false; },
        [](Case &c) { c.build.aliasedInputs = false; },
        [](Case &c) { c.build.lateInputs = false; },
        [](Case &c) { c.build.rerecorded = false; },
        [](Case &c) { c.build.backwards = false; },
        [](Case &c) { c.build.single = c.build.backwards = false; },
        [](Case &c) { c.build.secondDevice = false; },
        [](Case &c) { c.trace.secondary = false; },
        [](Case &c) { c.trace.method = TracePlan::Method::Query; },
        [](Case &c) { c.trace.stage = VK_SHADER_STAGE_COMPUTE_BIT; },
        [](Case &c) { c.trace.flags = TracePlan::Flags::RunTime; },
        [](Case &c) { c.trace.mode = TracePlan::Mode::True; },
        [](Case &c) { c.trace.besideBuild = false; },
        [](Case &c) { c.trace.boundFirst = false; },
        [](Case &c) { c.trace.pipelineLast = false; },
        [](Case &c) { c.trace.twice = false; },
        [](Case &c) { c.trace.rebound = false; },
        [](Case &c) { c.trace.vertexBuffers = false; },
        [](Case &c) { c.trace.attributes = HitAttributes::Vec2; },
        [](Case &c) { c.trace.maintenance6 = false; },
        [](Case &c) { c.trace.query = TracePlan::Query::Plain; },
        [](Case &c) { c.trace.shaderObjects = false; },
        [](Case &c) { c.trace.otherEntry = OtherEntry::None; },
        [](Case &c) { c.trace.optimized = false; },
        [](Case &c) { c.trace.signedFlags = false; },
        [](Case &c) { c.trace.firstDestroyed = false; },
        [](Case &c) { c.trace.tablesInPlace = false; },
        [](Case &c) { c.trace.tableBarrier = 0; },
        [](Case &c) { c.trace.unusedStage = false; },
        [](Case &c) { c.trace.launch.command = Launch::Direct; },
        [](Case &c) { c.trace.launch = {.command = c.trace.launch.command}; },
        [](Case &c) { c.trace.creation = 0; },
        [](Case &c) { c.trace.callables = false; },
        [](Case &c) { c.trace.byAddress = false; },
        [](Case &c) { c.trace.inlineModules = false; },
        [](Case &c) { c.trace.from = TracePlan::From::RayGeneration; },
        [](Case &c) { c.trace.flags2 = false; },
        [](Case &c) { c.trace.chained = 0; },
        [](Case &c) { c.trace.withoutMicromaps = false; },
        [](Case &c) { c.trace.dynamicStackSize = false; },
    };
    for (size_t i = 0; i < attempts.best().steps.size(); ++i) {
        for (bool Step::*const flag : {&Step::outOfPlace, &Step::structureFirst, &Step::relocated, &Step::mirrored,
                                       &Step::exact, &Step::update, &Step::inPlace, &Step::deferred, &Step::host})
            edits.emplace_back([i, flag](Case &c) { c.steps[i].*flag = false; });
        edits.emplace_back([i](Case &c) { c.steps[i].other = 0; });
        if (targetOf(attempts.best().steps[i].kind) == Target::Top)
            edits.emplace_back([i](Case &c) { c.steps[i].target = 0; });
        if (attempts.best().steps[i].kind == Kind::CloneMicromap ||
            attempts.best().steps[i].kind == Kind::ReloadMicromap)
            edits.emplace_back([i](Case &c) { c.steps[i].states.clear(); });
        // An update that changes nothing
        if (attempts.best().steps[i].kind == Kind::UpdateTop || attempts.best().steps[i].kind == Kind::RebuildTop)
            edits.emplace_back([i](Case &c) { c.steps[i].instances = c.scene.instances; });
    }
    for (const Bit &bit : kStructureFlagNames) {
        edits.emplace_back([&bit](Case &c) { c.scene.topFlags &= ~bit.value; });
        for (size_t i = 0; i < attempts.best().scene.objects.size(); ++i)
            edits.emplace_back([i, &bit](Case &c) { c.scene.objects[i].flags &= ~bit.value; });
    }
    for (size_t p = 0; p < attempts.best().queries.size(); ++p)
        for (size_t i = 0; i < attempts.best().queries[p].commands.size(); ++i)
            addQueryEdits(p, i, edits);
    attempts.attemptAll(edits);
    for (size_t i = 0; i < attempts.best().steps.size(); ++i) {
        for (const Kind kind : simplerThan(attempts.best().steps[i].kind)) {
            if (attempts.attempt([&](Case &c) {
                    c.steps[i].kind = kind;
                    c.steps[i].other = 0;
                    c.steps[i].relocated = c.steps[i].structureFirst = c.steps[i].mirrored = false;
                    c.steps[i].instances.clear();
                }))
                break;
        }
    }
}

} // namespace vellum::check
