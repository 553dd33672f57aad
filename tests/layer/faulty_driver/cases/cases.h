// SPDX-License-Identifier: Apache-2.0
// For each fault a scene that shows it, and the expected results without and with the fault. Vellum's layer treats
// indices, triangles and data that do not exist as unknown-opaque: state 3.
#pragma once

#include "gpu/tracer.h"
#include "harness/harness.h"

#include <ostream>
#include <string>

namespace faults
{

struct Case {
    const char *fault;
    std::string (*observe)(vt::Gpu &);
    const char *right;               // without the fault
    const char *wrong;               // with it
    std::optional<vt::Api> api = {}; // of the fault, if it is one API's
    const char *quirks = "";         // of the mock driver
};

// Printed by GoogleTest.
inline void PrintTo(const Case &c, std::ostream *out)
{
    *out << c.fault;
}

std::span<const Case> attachmentCases();
std::span<const Case> commandCases();
std::span<const Case> copyCases();
std::span<const Case> instanceCases();
std::span<const Case> micromapCases();

// Micro-triangles of one state each, one triangle for each state.
vt::MicromapInput uniform(std::initializer_list<uint8_t> states, uint32_t level = 2);

// The state of each triangle of a row (vt::triangleRow) at its middle: 0 to 3; 'n' where there is no micromap and the
// geometry is not opaque.
std::string statesOf(vt::Device &gpu, const vt::Structure &scene, uint32_t triangles);
// The states at these positions.
std::string statesAt(vt::Device &gpu, const vt::Structure &scene, std::span<const vt::Vec3> places);
// What each ray with these flags hits: '.' nothing, 'O' an opaque hit, 'n' a candidate for the shader. The rays hit the
// middle of the triangles.
std::string hitsOf(vt::Device &gpu, const vt::Structure &scene, uint32_t triangles, uint32_t flags,
                   uint32_t cullMask = 0xff);

// A bottom-level structure of one row of triangles with a micromap, and a scene of one instance.
class RowScene
{
public:
    RowScene(vt::Device &gpu, const vt::Micromap *micromap, uint32_t triangles, vt::Attachment attachment = {},
             VkGeometryFlagsKHR flags = 0, VkBuildAccelerationStructureFlagsKHR buildFlags = 0);
    // Updates the bottom-level structure and builds the scene again.
    void update(const vt::Micromap *micromap, vt::Attachment attachment);
    [[nodiscard]] const vt::Blas &blas() const { return *blas_; }
    [[nodiscard]] std::string states() { return statesOf(gpu_, *tlas_, triangles_); }
    [[nodiscard]] const vt::Tlas &tlas() const { return *tlas_; }

private:
    [[nodiscard]] vt::Geometry geometry(const vt::Micromap *micromap, vt::Attachment attachment) const;

    vt::Device &gpu_;
    uint32_t triangles_;
    VkGeometryFlagsKHR flags_;
    VkBuildAccelerationStructureFlagsKHR buildFlags_;
    std::unique_ptr<vt::Blas> blas_;
    std::unique_ptr<vt::Tlas> tlas_;
};

// A built micromap.
std::unique_ptr<vt::Micromap> built(vt::Device &gpu, vt::MicromapInput input, VkBuildMicromapFlagsEXT flags = 0);
// Builds `target` from the input of `source`, which is as large.
void buildFrom(vt::Device &gpu, const vt::Micromap &source, const vt::Micromap &target);
// The states of a micromap's triangles at their middle.
std::string statesOfMicromap(vt::Device &gpu, const vt::Micromap &micromap);

} // namespace faults
