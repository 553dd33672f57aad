// SPDX-License-Identifier: Apache-2.0
// The memory of buffers, addresses and structures, for the tracker.
#pragma once

#include "layer/validation/sync/sync_tracker.h"

namespace vellum::layer
{

struct DeviceValidation;

namespace sync
{

// Memory, and what a message names for it.
struct Location {
    Range range; // empty: unknown, or of no interest
    bool exclusive = false;
    ObjectHandle object;
};

// The first bytes of a structure, which nothing but the structure accesses: how much of its size commands access is not
// known, and sizes may overlap.
Location locationOf(const ValidatedStructure *structure);
Location locationAt(const DeviceValidation &device, VkDeviceAddress address, VkDeviceSize size);
// Of buffers that structures or their builds may access; empty for others.
Location locationIn(const DeviceValidation &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size);
// The same for any buffer.
Range rangeIn(const DeviceValidation &device, VkBuffer buffer, VkDeviceSize offset, VkDeviceSize size);

} // namespace sync
} // namespace vellum::layer
