// SPDX-License-Identifier: Apache-2.0
// The names of this copy of the layer. They are in a file of their own so that the tests can build a second copy, with
// other names, from the same static library.
#include "layer/base/settings.h"

#ifndef VELLUM_COPY
#define VELLUM_COPY "VK_LAYER_VELLUM_opacity_micromap", "VELLUM_", ""
#endif

namespace vellum::layer
{
namespace
{

struct Copy {
    const char *name;
    const char *variablePrefix;
    const char *messagePrefix;
};
constexpr Copy kCopy{VELLUM_COPY};

} // namespace

const char *const kLayerName = kCopy.name;
const char *const kVariablePrefix = kCopy.variablePrefix;
const char *const kMessagePrefix = kCopy.messagePrefix;

} // namespace vellum::layer
