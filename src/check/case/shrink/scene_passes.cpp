// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <cmath>
#include <span>

#include "check/case/address_copies.h"
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
    Case best = attempts.best();
    forEachInstances(best, [&](const std::vector<oracle::Instance> &instances) {
        for (size_t i = 0; i < instances.size(); ++i)
            for (const auto &change : simplerFields(instances[i]))
                edits.push_back(ofInstance(i, change));
    });
    for (size_t o = 0; o < best.scene.objects.size(); ++o) {
        addSimpler(edits, best, [o](auto &c) { return &c.scene.objects[o]; });
        for (size_t m = 0; m < best.scene.objects[o].meshes.size(); ++m) {
            addSimpler(edits, best, [o, m](auto &c) { return &c.scene.objects[o].meshes[m]; });
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
    const Case &best = attempts.best();
    std::vector<Edit> edits;
    for (size_t o = 0; o < best.scene.objects.size(); ++o)
        for (size_t m = 0; m < best.scene.objects[o].meshes.size(); ++m)
            addSimpler(edits, best, [o, m](auto &c) { return &c.scene.objects[o].meshes[m].layout; });
    attempts.attemptAll(edits);
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
    for (size_t i = 0; i < attempts.best().scene.rays.size(); ++i)
        addSimpler(edits, attempts.best(), [i](auto &c) { return &c.scene.rays[i]; });
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
        for (const auto &change : simplerFields(pipeline()))
            edit(change);
        for (size_t t = 0; t <= pipeline().otherTables.size(); ++t) {
            const auto editTable = [&](const std::function<void(TablePlan &)> &change) {
                edit([&](PipelinePlan &plan) { change(tableOf(plan, t)); });
            };
            PipelinePlan plan = pipeline();
            editTable([](TablePlan &table) { table.records = {oracle::HitRecord::Full}; });
            editTable([](TablePlan &table) { table.layout = {}; });
            for (const auto &change : simplerFields(tableOf(plan, t)))
                editTable(change);
        }
    }
}

// Smaller numbers of copies at addresses that cannot be the simplest.
void lowerAddressNumbers(Attempts &attempts)
{
    struct Number {
        std::function<uint32_t &(AddressPlan &)> of;
        uint32_t least;
    };
    std::vector<Number> numbers;
    const std::vector<AddressCommand> &commands = attempts.best().addressCopies.commands;
    const auto add = [&](size_t i, size_t k, uint32_t AddressRegion::*member, uint32_t least) {
        numbers.push_back(
            {[=](AddressPlan &plan) -> uint32_t & { return plan.commands[i].regions[k].*member; }, least});
    };
    for (size_t i = 0; i < commands.size(); ++i)
        for (size_t k = 0; k < commands[i].regions.size(); ++k) {
            for (const auto member : {&AddressRegion::spare, &AddressRegion::offset})
                add(i, k, member, 0);
            if (!usesImage(commands[i])) {
                for (const auto member : {&AddressRegion::size, &AddressRegion::fromOffset})
                    add(i, k, member, 0);
                continue;
            }
            for (const auto member : {&AddressRegion::x, &AddressRegion::y, &AddressRegion::z,
                                      &AddressRegion::rowLength, &AddressRegion::imageHeight})
                add(i, k, member, 0);
            for (const auto member :
                 {&AddressRegion::width, &AddressRegion::height, &AddressRegion::depth, &AddressRegion::layers})
                add(i, k, member, 1);
        }
    for (const auto member :
         {&AddressPlan::width, &AddressPlan::height, &AddressPlan::depth, &AddressPlan::levels, &AddressPlan::layers})
        numbers.push_back({[member](AddressPlan &plan) -> uint32_t & { return plan.*member; }, 1});
    for (const Number &number : numbers) {
        AddressPlan plan = attempts.best().addressCopies;
        for (uint32_t by = std::bit_floor(number.of(plan)); by > 0; by /= 2)
            attempts.attempt([&](Case &c) {
                uint32_t &value = number.of(c.addressCopies);
                value -= value >= by + number.least ? by : 0;
            });
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

void simplifyPlans(Attempts &attempts)
{
    simplifyPipelines(attempts);
    const Case &best = attempts.best();
    std::vector<Edit> edits{
        [](Case &c) { c.memory = Memory::Apart; },
        [](Case &c) { c.build.together = c.build.mixed = false; },
        [](Case &c) { c.build.single = c.build.backwards = false; },
        [](Case &c) {
            if (c.build.conditional != Conditional::None)
                c.build.conditional = Conditional::False;
        },
        [](Case &c) { c.trace.launch = {.command = c.trace.launch.command}; },
    };
    addSimpler(edits, best, [](auto &c) { return &c.build; });
    addSimpler(edits, best, [](auto &c) { return &c.trace; });
    for (const Bit &bit : kStructureFlagNames)
        edits.emplace_back([&bit](Case &c) { c.scene.topFlags &= ~bit.value; });
    for (size_t i = 0; i < best.steps.size(); ++i) {
        addSimpler(edits, best, [i](auto &c) { return &c.steps[i]; });
        if (best.steps[i].kind == Kind::CloneMicromap || best.steps[i].kind == Kind::ReloadMicromap)
            edits.emplace_back([i](Case &c) { c.steps[i].states.clear(); });
        // An update that changes nothing
        if (best.steps[i].kind == Kind::UpdateTop || best.steps[i].kind == Kind::RebuildTop)
            edits.emplace_back([i](Case &c) { c.steps[i].instances = c.scene.instances; });
    }
    for (size_t p = 0; p < best.queries.size(); ++p)
        for (size_t i = 0; i < best.queries[p].commands.size(); ++i) {
            addSimpler(edits, best, [p, i](auto &c) { return &c.queries[p].commands[i]; });
            if (best.queries[p].commands[i].kind == QueryCommand::Kind::ResetOnHost)
                edits.emplace_back([p, i](Case &c) { c.queries[p].commands[i].kind = QueryCommand::Kind::Reset; });
        }
    addSimpler(edits, best, [](auto &c) { return &c.addressCopies; });
    for (size_t i = 0; i < best.addressCopies.commands.size(); ++i) {
        addSimpler(edits, best, [i](auto &c) { return &c.addressCopies.commands[i]; });
        for (size_t k = 0; k < best.addressCopies.commands[i].regions.size(); ++k)
            addSimpler(edits, best, [i, k](auto &c) { return &c.addressCopies.commands[i].regions[k]; });
    }
    attempts.attemptAll(edits);
    lowerAddressNumbers(attempts);
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
