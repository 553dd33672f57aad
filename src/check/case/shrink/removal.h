// SPDX-License-Identifier: Apache-2.0
// Removes parts of a case, and whatever refers to them; references to other parts are renumbered.
#pragma once

#include <functional>

#include "check/case/case.h"

namespace vellum::check
{

// True if there is no index buffer.
inline bool isDirect(const oracle::MeshMicromap &use)
{
    return use.indexType == VK_INDEX_TYPE_NONE_KHR;
}
// Calls the function for every use of a micromap by that mesh: the scene's and those of steps.
void forEachUse(Case &c, uint32_t object, uint32_t mesh, const std::function<void(oracle::MeshMicromap &)> &function);
void forEachUse(Case &c, const std::function<void(oracle::MeshMicromap &)> &function);
bool isUsed(const Case &c, uint32_t micromap);
// Calls it for the scene's instances and those of steps, which are as many.
void forEachInstances(Case &c, const std::function<void(std::vector<oracle::Instance> &)> &function);
void removeInstances(Case &c, size_t from, size_t count);

// Removes a query of a pool from all commands that use it.
void removeQuery(QueryPlan &plan, uint32_t query);

// Calls it for the triangles of a micromap: the scene's and those of steps.
void forEachStates(Case &c, uint32_t micromap,
                   const std::function<void(std::vector<oracle::MicromapTriangle> &)> &function);

// With its instances and the steps on it.
void removeObject(Case &c, uint32_t object);
void removeMeshes(Case &c, uint32_t object, size_t from, size_t count);
// Or boxes. Without an index buffer, the triangles behind use other micromap triangles afterwards, unless
// `withMicromap`: those of the micromap are removed as well.
void removeTriangles(Case &c, uint32_t object, uint32_t mesh, size_t from, size_t count, bool withMicromap);
// With its uses.
void removeMicromap(Case &c, uint32_t micromap);
// Uses that refer to one of them have the special index for its first state instead.
void removeMicromapTriangles(Case &c, uint32_t micromap, size_t from, size_t count);

} // namespace vellum::check
