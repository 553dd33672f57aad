// SPDX-License-Identifier: Apache-2.0
// The commands of an AddressPlan on the host: those that are allowed, and the bytes that they leave.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "check/case/case.h"

namespace vellum::check
{

// The content of the buffers of a plan, and then of its image: its levels, of these the layers, without gaps.
using AddressMemory = std::vector<std::vector<uint8_t>>;

// What forbids the buffers and the image of the plan, or a command; empty: nothing.
std::string brokenRule(const AddressPlan &plan);
std::string brokenRule(const AddressPlan &plan, const AddressCommand &command);

bool usesImage(const AddressCommand &command);
bool usesImage(const AddressPlan &plan);
// Of a level of the image
VkExtent3D extentOf(const AddressPlan &plan, uint32_t level);
uint64_t texelSize(const AddressPlan &plan);
// Where a level of the image begins in its content.
uint64_t levelOffset(const AddressPlan &plan, uint32_t level);
// The bytes of the address range of a region that is written, or copied to an image.
uint64_t rangeSize(const AddressPlan &plan, const AddressCommand &command, const AddressRegion &region);
// The data of vkCmdUpdateMemoryKHR.
std::vector<uint8_t> updateData(const AddressCommand &command);

// The content before all commands.
AddressMemory memoryBefore(const AddressPlan &plan);
void carryOut(const AddressPlan &plan, const AddressCommand &command, AddressMemory &memory);
// The fault of a command that left other content than expected, with the cause before parentheses; empty: none.
std::string addressFault(const AddressPlan &plan, size_t command, const AddressMemory &expected,
                         const AddressMemory &found);

} // namespace vellum::check
