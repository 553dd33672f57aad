// SPDX-License-Identifier: Apache-2.0
// Many micromaps in many bottom-level structures. The expected state of each micro-triangle is not stored: it is a
// function of the micromap's number and version. Objects are packed into the arena of the device, which must have one.
// Copies move them into freed memory, with exactly the size that is reported for them.
#pragma once

#include <cstdint>

#include "gpu/tracer.h"
#include "harness/harness.h"

namespace stress
{

struct Extent {
    uint32_t blases, geometries, triangles; // geometries of a structure, triangles of a geometry
    uint32_t instances, rays, frames, warmUp;
    [[nodiscard]] uint32_t micromaps() const { return blases * geometries; }
};

uint32_t mix(uint32_t a, uint32_t b, uint32_t c = 0);

// The triangles of a micromap; the states change with the version.
uint32_t levelOf(uint32_t micromap, uint32_t triangle);
uint16_t formatOf(uint32_t micromap, uint32_t triangle);
uint8_t stateOf(uint32_t micromap, uint32_t version, uint32_t triangle, uint32_t index);

class World
{
public:
    World(vt::Gpu &gpu, const Extent &extent);
    World(const World &) = delete;
    World &operator=(const World &) = delete;
    ~World();

    // Changes to a structure, after which it has the expected states.
    enum class Change {
        DataUpdate,
        MicromapClone,
        MicromapCompact,
        MicromapReload,
        Rebuild,
        Clone,
        Compact,
        Reload,
        Count
    };
    void change(uint32_t blas, Change change, uint32_t geometry);

    [[nodiscard]] VkDeviceAddress address(uint32_t blas) const { return blases_[blas].address; }
    // The value 0..3 that a triangle of a structure has at a micro-triangle (a number that is taken modulo how many
    // there are), and the place of that one's centre.
    struct Place {
        int state;
        vt::Vec3 point;
    };
    [[nodiscard]] Place place(uint32_t blas, uint32_t geometry, uint32_t triangle, uint32_t index) const;
    [[nodiscard]] static bool opaque(uint32_t geometry) { return geometry % 2 == 1; }

private:
    struct Map {
        vt::MicromapHandle handle;
        vt::Guarded memory;
        uint32_t version = 0;
    };
    struct Bottom {
        VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
        VkDeviceAddress address = 0;
        vt::Guarded memory;
    };
    struct Description;

    void makeGeometry();
    void fillInput(uint32_t micromap, uint32_t version);
    void buildMicromap(uint32_t micromap);
    void copyMicromap(uint32_t micromap, VkCopyMicromapModeEXT mode);
    void reloadMicromap(uint32_t micromap);
    VkDeviceSize queriedSize(uint32_t micromap, VkQueryType type);
    VkDeviceSize queriedSize(VkAccelerationStructureKHR blas, VkQueryType type);
    // Creates one of that size in new memory, and returns the old one.
    Map replaceMicromap(uint32_t micromap, VkDeviceSize bytes);
    Bottom replaceBlas(uint32_t blas, VkDeviceSize bytes);
    void destroy(Map micromap);
    void destroy(Bottom blas);
    void build(uint32_t blas, VkBuildAccelerationStructureModeKHR mode);
    void copy(uint32_t blas, VkCopyAccelerationStructureModeKHR mode);
    void reload(uint32_t blas);

    vt::Gpu &gpu_;
    Extent extent_;
    std::vector<Map> micromaps_;
    std::vector<Bottom> blases_;
    vt::Guarded vertices_, indices_, data_, triangles_, scratch_;
    VkDeviceSize micromapBytes_ = 0, blasBytes_ = 0;
};

} // namespace stress
