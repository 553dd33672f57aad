// SPDX-License-Identifier: Apache-2.0
#include <set>

#include "check/case/case.h"
#include "check/case/shrink/passes.h"
#include "check/case/shrink/removal.h"

namespace vellum::check
{
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
    removeObjects(attempts);
    removeMicromaps(attempts);
    removeTrianglesOfMeshes(attempts);
    removeMicromaps(attempts);
}

} // namespace vellum::check
