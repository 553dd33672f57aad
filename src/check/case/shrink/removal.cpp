// SPDX-License-Identifier: Apache-2.0
#include "check/case/shrink/removal.h"

#include <algorithm>
#include <set>

#include "check/case/address_copies.h"
#include "check/case/case.h"
#include "check/case/shrink/passes.h"

namespace vellum::check
{
namespace
{

using oracle::Mesh;
using oracle::MeshMicromap;
using Kind = Step::Kind;

template <class T>
void eraseFrom(std::vector<T> &list, size_t from, size_t count)
{
    from = std::min(from, list.size());
    count = std::min(count, list.size() - from);
    list.erase(list.begin() + static_cast<ptrdiff_t>(from), list.begin() + static_cast<ptrdiff_t>(from + count));
}

void eraseSteps(Case &c, const std::function<bool(const Step &)> &which)
{
    std::erase_if(c.steps, which);
}

void closeGap(uint32_t &number, uint32_t removed)
{
    number -= number > removed ? 1u : 0u;
}

// Queries of what is removed are about the first one of its kind instead.
void removeTarget(Case &c, QueryTarget::Of of, uint32_t removed)
{
    for (QueryPlan &plan : c.queries)
        for (QueryCommand &command : plan.commands)
            for (QueryTarget &target : command.targets) {
                if (target.of != of)
                    continue;
                if (target.number == removed)
                    target.number = 0;
                closeGap(target.number, removed);
            }
}

// Returns whether `other` is an object.
bool namesObject(Kind kind)
{
    return kind == Kind::MoveObject || kind == Kind::ReplaceObject;
}

void removeIndices(MeshMicromap &use, size_t from, size_t count)
{
    if (use.indices.empty())
        return;
    const int32_t first = use.indices[0];
    if (isDirect(use))
        from = use.indices.size() - std::min(count, use.indices.size());
    eraseFrom(use.indices, from, count);
    if (use.stride == 0u && !use.indices.empty())
        use.indices[0] = first; // read by all triangles
}

// The position that a triangle of a micromap has when others are removed.
size_t positionAfter(size_t position, size_t from, size_t count)
{
    return position < from ? position : position < from + count ? from : position - count;
}

// `triangles`: of the micromap, before they are removed.
void renumber(MeshMicromap &use, const std::vector<oracle::MicromapTriangle> &triangles, size_t from, size_t count)
{
    const size_t base = positionAfter(use.base, from, count);
    for (int32_t &index : use.indices) {
        if (index < 0 || isDirect(use))
            continue;
        const size_t position = static_cast<size_t>(index) + use.base;
        if (position >= from && position < from + count)
            index = position < triangles.size() && !triangles[position].states.empty()
                        ? -1 - static_cast<int32_t>(triangles[position].states[0])
                        : -1;
        else
            index = static_cast<int32_t>(positionAfter(position, from, count) - base);
    }
    use.base = static_cast<uint32_t>(base);
}

} // namespace

void forEachUse(Case &c, uint32_t object, uint32_t mesh, const std::function<void(MeshMicromap &)> &function)
{
    if (auto &use = c.scene.objects[object].meshes[mesh].micromap)
        function(*use);
    for (Step &step : c.steps)
        if (step.kind == Kind::SetIndices && step.target == object && step.other == mesh && step.micromapUse)
            function(*step.micromapUse);
}

void forEachUse(Case &c, const std::function<void(MeshMicromap &)> &function)
{
    for (uint32_t o = 0; o < c.scene.objects.size(); ++o)
        for (uint32_t m = 0; m < c.scene.objects[o].meshes.size(); ++m)
            forEachUse(c, o, m, function);
}

bool isUsed(const Case &c, uint32_t micromap)
{
    const auto uses = [&](const std::optional<MeshMicromap> &use) { return use && use->micromap == micromap; };
    return std::ranges::any_of(c.steps, [&](const Step &step) { return uses(step.micromapUse); }) ||
           std::ranges::any_of(c.scene.objects, [&](const oracle::Object &object) {
               return std::ranges::any_of(object.meshes, [&](const Mesh &mesh) { return uses(mesh.micromap); });
           });
}

void forEachStates(Case &c, uint32_t micromap,
                   const std::function<void(std::vector<oracle::MicromapTriangle> &)> &function)
{
    function(c.scene.micromaps[micromap].triangles);
    for (Step &step : c.steps)
        if (targetOf(step.kind) == Target::Micromap && step.target == micromap && !step.states.empty())
            function(step.states);
}

void forEachInstances(Case &c, const std::function<void(std::vector<oracle::Instance> &)> &function)
{
    function(c.scene.instances);
    for (Step &step : c.steps)
        if (step.kind == Kind::UpdateTop || step.kind == Kind::RebuildTop)
            function(step.instances);
}

void removeQuery(QueryPlan &plan, uint32_t query)
{
    for (QueryCommand &command : plan.commands) {
        if (command.kind == QueryCommand::Kind::WriteOnHost)
            continue;
        if (query >= command.first && query < command.first + command.count) {
            command.count -= 1;
            eraseFrom(command.targets, query - command.first, 1);
        }
        closeGap(command.first, query);
    }
    std::erase_if(plan.commands, [](const QueryCommand &command) { return command.count == 0; });
    plan.count -= 1;
}

void removeInstances(Case &c, size_t from, size_t count)
{
    forEachInstances(c, [&](std::vector<oracle::Instance> &instances) { eraseFrom(instances, from, count); });
}

void removeObject(Case &c, uint32_t object)
{
    for (size_t i = c.scene.instances.size(); i-- > 0;) {
        bool uses = false;
        forEachInstances(c, [&](const auto &all) { uses |= i < all.size() && all[i].object == object; });
        if (uses)
            removeInstances(c, i, 1);
    }
    forEachInstances(c, [&](std::vector<oracle::Instance> &instances) {
        for (oracle::Instance &instance : instances)
            closeGap(instance.object, object);
    });
    eraseSteps(c, [&](const Step &step) {
        return targetOf(step.kind) == Target::Object &&
               (step.target == object || (namesObject(step.kind) && step.other == object));
    });
    for (Step &step : c.steps) {
        if (targetOf(step.kind) == Target::Object)
            closeGap(step.target, object);
        if (namesObject(step.kind))
            closeGap(step.other, object);
    }
    removeTarget(c, QueryTarget::Of::Object, object);
    eraseFrom(c.scene.objects, object, 1);
}

void removeMeshes(Case &c, uint32_t object, size_t from, size_t count)
{
    const auto ofMeshes = [&](const Step &step) { return step.kind == Kind::SetIndices && step.target == object; };
    eraseSteps(c, [&](const Step &step) { return ofMeshes(step) && step.other - from < count && step.other >= from; });
    for (Step &step : c.steps)
        if (ofMeshes(step) && step.other >= from)
            step.other -= static_cast<uint32_t>(count);
    eraseFrom(c.scene.objects[object].meshes, from, count);
}

void removeTriangles(Case &c, uint32_t object, uint32_t mesh, size_t from, size_t count, bool withMicromap)
{
    Mesh &of = c.scene.objects[object].meshes[mesh];
    if (!of.boxes.empty())
        return eraseFrom(of.boxes, from, count);
    if (withMicromap && of.micromap && of.micromap->micromap && isDirect(*of.micromap)) {
        const uint32_t micromap = *of.micromap->micromap;
        const size_t first = from + of.micromap->base;
        // The mesh's own base stays: what is removed is at it or behind.
        removeMicromapTriangles(c, micromap, first, count);
    }
    forEachUse(c, object, mesh, [&](MeshMicromap &use) { removeIndices(use, from, count); });
    eraseFrom(of.vertices, 3 * from, 3 * count);
}

void removeMicromap(Case &c, uint32_t micromap)
{
    const auto drop = [&](std::optional<MeshMicromap> &use) {
        if (use && use->micromap == micromap)
            use.reset();
        if (use && use->micromap)
            closeGap(*use->micromap, micromap);
    };
    for (oracle::Object &object : c.scene.objects)
        for (Mesh &mesh : object.meshes)
            drop(mesh.micromap);
    eraseSteps(c, [&](const Step &step) { return targetOf(step.kind) == Target::Micromap && step.target == micromap; });
    for (Step &step : c.steps) {
        drop(step.micromapUse);
        if (targetOf(step.kind) == Target::Micromap)
            closeGap(step.target, micromap);
    }
    removeTarget(c, QueryTarget::Of::Micromap, micromap);
    eraseFrom(c.scene.micromaps, micromap, 1);
}

void removeMicromapTriangles(Case &c, uint32_t micromap, size_t from, size_t count)
{
    const std::vector<oracle::MicromapTriangle> &triangles = c.scene.micromaps[micromap].triangles;
    forEachUse(c, [&](MeshMicromap &use) {
        if (use.micromap == micromap)
            renumber(use, triangles, from, count);
    });
    forEachStates(c, micromap, [&](auto &states) { eraseFrom(states, from, count); });
}

namespace
{

template <class List>
auto erase(List list)
{
    return [list](Case &c, size_t from, size_t count) {
        auto &of = list(c);
        const auto begin = of.begin() + static_cast<ptrdiff_t>(from);
        of.erase(begin, begin + static_cast<ptrdiff_t>(count));
    };
}

// Removes one after the other.
template <class RemoveOne>
auto eachOf(RemoveOne removeOne)
{
    return [removeOne](Case &c, size_t from, size_t count) {
        for (size_t i = from + count; i-- > from;)
            removeOne(c, static_cast<uint32_t>(i));
    };
}

void removeSteps(Attempts &attempts)
{
    attempts.removeStretches(attempts.best().steps.size(), erase([](Case & c) -> auto & { return c.steps; }));
    // Makes the scene what a step makes of it, from the beginning.
    for (size_t i = attempts.best().steps.size(); i-- > 0;) {
        attempts.attempt([&](Case &c) {
            const Step step = c.steps[i];
            c.steps.erase(c.steps.begin() + static_cast<ptrdiff_t>(i));
            applyTo(c.scene, step);
        });
    }
}

void removeQueries(Attempts &attempts)
{
    attempts.removeStretches(attempts.best().queries.size(), erase([](Case & c) -> auto & { return c.queries; }));
    for (size_t p = 0; p < attempts.best().queries.size(); ++p) {
        attempts.removeStretches(attempts.best().queries[p].commands.size(),
                                 erase([p](Case & c) -> auto & { return c.queries[p].commands; }));
        attempts.removeStretches(attempts.best().queries[p].count,
                                 eachOf([p](Case &c, uint32_t query) { removeQuery(c.queries[p], query); }));
    }
}

void removeAddressCopies(Attempts &attempts)
{
    attempts.attempt([](Case &c) { c.addressCopies = {}; });
    attempts.removeStretches(attempts.best().addressCopies.commands.size(),
                             erase([](Case & c) -> auto & { return c.addressCopies.commands; }));
    for (size_t i = 0; i < attempts.best().addressCopies.commands.size(); ++i)
        attempts.removeStretches(attempts.best().addressCopies.commands[i].regions.size(),
                                 erase([i](Case & c) -> auto & { return c.addressCopies.commands[i].regions; }));
    // Buffers that are as small as the ranges in them allow, then those that have none.
    attempts.attempt([](Case &c) {
        AddressPlan &plan = c.addressCopies;
        std::vector<uint64_t> ends(plan.buffers.size());
        for (const AddressCommand &command : plan.commands)
            for (const AddressRegion &region : command.regions) {
                const uint64_t end = region.offset + rangeSize(plan, command, region);
                ends[region.buffer] = std::max(ends[region.buffer], end);
                if (command.kind == AddressCommand::Kind::Copy)
                    ends[region.from] = std::max(ends[region.from], uint64_t{region.fromOffset} + region.size);
            }
        for (size_t i = 0; i < ends.size(); ++i)
            plan.buffers[i] = static_cast<uint32_t>(std::max<uint64_t>(ends[i], 1));
    });
    attempts.removeStretches(attempts.best().addressCopies.buffers.size(), eachOf([](Case &c, uint32_t buffer) {
                                 for (AddressCommand &command : c.addressCopies.commands)
                                     for (AddressRegion &region : command.regions) {
                                         closeGap(region.buffer, buffer);
                                         closeGap(region.from, buffer);
                                     }
                                 eraseFrom(c.addressCopies.buffers, buffer, 1);
                             }));
}

void removeObjects(Attempts &attempts)
{
    attempts.removeStretches(attempts.best().scene.instances.size(), removeInstances);
    attempts.removeStretches(attempts.best().scene.objects.size(), eachOf(removeObject));
    // Users of the object use another one.
    attempts.removeStretches(attempts.best().scene.objects.size(), eachOf([](Case &c, uint32_t object) {
                                 forEachInstances(c, [&](std::vector<oracle::Instance> &instances) {
                                     for (oracle::Instance &instance : instances)
                                         if (instance.object == object)
                                             instance.object = object == 0 ? 1 : 0;
                                 });
                                 removeObject(c, object);
                             }));
    for (uint32_t o = 0; o < attempts.best().scene.objects.size(); ++o)
        attempts.removeStretches(attempts.best().scene.objects[o].meshes.size(),
                                 [o](Case &c, size_t from, size_t count) { removeMeshes(c, o, from, count); });
}

void removeTrianglesOfMeshes(Attempts &attempts)
{
    for (uint32_t o = 0; o < attempts.best().scene.objects.size(); ++o) {
        for (uint32_t m = 0; m < attempts.best().scene.objects[o].meshes.size(); ++m) {
            for (const bool withMicromap : {true, false}) {
                const oracle::Mesh &mesh = attempts.best().scene.objects[o].meshes[m];
                attempts.removeStretches(
                    mesh.boxes.empty() ? mesh.triangles() : mesh.boxes.size(),
                    [&](Case &c, size_t from, size_t count) { removeTriangles(c, o, m, from, count, withMicromap); });
            }
        }
    }
}

// The triangles of a micromap that no use refers to.
std::vector<uint32_t> unusedTriangles(const Case &c, uint32_t micromap)
{
    std::set<size_t> used;
    const auto add = [&](const std::optional<oracle::MeshMicromap> &use) {
        if (use && use->micromap == micromap)
            for (const int32_t index : use->indices)
                if (index >= 0)
                    used.insert(static_cast<size_t>(index) + use->base);
    };
    for (const oracle::Object &object : c.scene.objects)
        for (const oracle::Mesh &mesh : object.meshes)
            add(mesh.micromap);
    for (const Step &step : c.steps)
        add(step.micromapUse);
    std::vector<uint32_t> unused;
    for (uint32_t i = 0; i < c.scene.micromaps[micromap].triangles.size(); ++i)
        if (!used.contains(i))
            unused.push_back(i);
    return unused;
}

void removeMicromaps(Attempts &attempts)
{
    const auto removeUnused = [&] {
        attempts.attempt([](Case &c) {
            for (uint32_t i = static_cast<uint32_t>(c.scene.micromaps.size()); i-- > 0;)
                if (!isUsed(c, i))
                    removeMicromap(c, i);
        });
    };
    removeUnused();
    std::vector<Edit> edits;
    for (size_t o = 0; o < attempts.best().scene.objects.size(); ++o)
        for (size_t m = 0; m < attempts.best().scene.objects[o].meshes.size(); ++m)
            if (attempts.best().scene.objects[o].meshes[m].micromap)
                edits.emplace_back([o, m](Case &c) { c.scene.objects[o].meshes[m].micromap.reset(); });
    attempts.attemptAll(edits);
    removeUnused();
    attempts.removeStretches(attempts.best().scene.micromaps.size(), eachOf(removeMicromap));
    for (uint32_t i = 0; i < attempts.best().scene.micromaps.size(); ++i) {
        attempts.attempt([&](Case &c) {
            const std::vector<uint32_t> unused = unusedTriangles(c, i);
            for (size_t end = unused.size(); end > 0;) { // stretches of them
                size_t k = end - 1;
                while (k > 0 && unused[k - 1] + 1 == unused[k])
                    --k;
                removeMicromapTriangles(c, i, unused[k], end - k);
                end = k;
            }
        });
        attempts.removeStretches(
            attempts.best().scene.micromaps[i].triangles.size(),
            [&](Case &c, size_t from, size_t count) { removeMicromapTriangles(c, i, from, count); });
    }
}

} // namespace

void removeRays(Attempts &attempts, std::optional<uint32_t> ray)
{
    const size_t count = attempts.best().scene.rays.size();
    if (ray && *ray < count)
        attempts.attempt([&](Case &c) { c.scene.rays = {c.scene.rays[*ray]}; });
    attempts.removeStretches(attempts.best().scene.rays.size(), erase([](Case & c) -> auto & { return c.scene.rays; }));
}

void removeParts(Attempts &attempts)
{
    removeSteps(attempts);
    removeQueries(attempts);
    removeAddressCopies(attempts);
    removeObjects(attempts);
    removeMicromaps(attempts);
    removeTrianglesOfMeshes(attempts);
    removeMicromaps(attempts);
}

} // namespace vellum::check
