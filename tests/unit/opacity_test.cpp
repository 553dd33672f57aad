// SPDX-License-Identifier: Apache-2.0
// The resolution of a hit, against the specification's sections "Ray Opacity Micromap" and "Ray Opacity" written out as
// tables.
#include <gtest/gtest.h>

#include <optional>

#include "core/opacity.h"

using namespace vellum::shared;

namespace
{

// The effect of a state before the flags: I ignored, O opaque, N non-opaque.
struct StateRow {
    uint state;
    bool geometryOpaque;
    char fourState;
    char twoState; // with Force2State of the instance or the ray
    char disabled; // with DisableMicromaps of the instance
};

constexpr StateRow kStates[] = {
    {kStateTransparent, false, 'I', 'I', 'N'},
    {kStateTransparent, true, 'I', 'I', 'O'},
    {kStateOpaque, false, 'O', 'O', 'N'},
    {kStateOpaque, true, 'O', 'O', 'O'},
    {kStateUnknownTransparent, false, 'N', 'I', 'N'},
    {kStateUnknownTransparent, true, 'N', 'I', 'O'},
    {kStateUnknownOpaque, false, 'N', 'O', 'N'},
    {kStateUnknownOpaque, true, 'N', 'O', 'O'},
    {kStateNone, false, 'N', 'N', 'N'},
    {kStateNone, true, 'O', 'O', 'O'},
};

constexpr uint kRayOpacity[] = {0, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque};
constexpr uint kInstanceOpacity[] = {0, kInstanceForceOpaque, kInstanceForceNoOpaque};

// The outcome of an opaque and of a non-opaque hit: rows by kInstanceOpacity, columns by kRayOpacity.
constexpr char kOpaque[3][6] = {"OONIO", "OONIO", "NONNI"};
constexpr char kNonOpaque[3][6] = {"NONNI", "OONIO", "NONNI"};

uint outcome(char letter)
{
    return letter == 'I' ? kHitIgnored : letter == 'O' ? kHitOpaque : kHitNonOpaque;
}

} // namespace

TEST(Opacity, WholeTable)
{
    for (const StateRow &row : kStates) {
        for (size_t i = 0; i < 3; ++i) {
            for (size_t r = 0; r < 5; ++r) {
                for (unsigned flags = 0; flags < 8; ++flags) {
                    const uint instance = kInstanceOpacity[i] | ((flags & 1) != 0 ? kInstanceForce2State : 0) |
                                          ((flags & 2) != 0 ? kInstanceDisableMicromaps : 0);
                    const uint ray = kRayOpacity[r] | ((flags & 4) != 0 ? kRayForce2State : 0);
                    const char found = (flags & 2) != 0   ? row.disabled
                                       : (flags & 5) != 0 ? row.twoState
                                                          : row.fourState;
                    const char wanted = found == 'I' ? 'I' : found == 'O' ? kOpaque[i][r] : kNonOpaque[i][r];
                    EXPECT_EQ(resolveHit(row.state, row.geometryOpaque, instance, ray), outcome(wanted))
                        << "state " << row.state << ", opaque " << row.geometryOpaque << ", instance flags " << instance
                        << ", ray flags " << ray;
                }
            }
        }
    }
}

TEST(Opacity, OtherFlagsDoNotMatter)
{
    constexpr uint kOtherRay = 0x004 | 0x008 | 0x010 | 0x020 | 0x100 | 0x200; // terminate, skip, facing, primitives
    constexpr uint kOtherInstance = 0x01 | 0x02;                              // facing
    for (const StateRow &row : kStates)
        for (const uint i : kInstanceOpacity)
            for (const uint r : kRayOpacity)
                EXPECT_EQ(resolveHit(row.state, row.geometryOpaque, i, r),
                          resolveHit(row.state, row.geometryOpaque, i | kOtherInstance, r | kOtherRay));
}

// What the driver does not get is read back from the table.
TEST(Opacity, TablesStateFlags)
{
    for (uint flags = 0; flags < 0x40; ++flags) {
        const uint withIndex = hitTable(flags) | 0x00ffffffu;
        EXPECT_EQ(flagsInTable(withIndex), flags & (kInstanceForceOpaque | kInstanceForce2State)) << flags;
    }
}
