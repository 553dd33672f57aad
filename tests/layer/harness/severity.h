// SPDX-License-Identifier: Apache-2.0
// The severity of the layer's messages about wrong input: tolerated input is a warning, rejected input an error. With
// validation, both are errors.
#pragma once

#include <cstdlib>

#include "harness/harness.h"

namespace vt
{

inline VkDebugUtilsMessageSeverityFlagBitsEXT expectedSeverity(const Message &m)
{
    return m.text.ends_with("; the layer goes on") && !std::getenv("VELLUM_VALIDATE")
               ? VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT
               : VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
}

} // namespace vt
