// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/device_model.h"

#include <cinttypes>
#include <cstdio>

namespace vellum::layer
{

void DeviceModel::fault(const std::string &place, const char *vuid, const std::string &text, ObjectHandle object)
{
    driver.report().fault(vuid, place + ": " + text, object.type, object.handle);
}

std::string DeviceModel::nameOf(ObjectHandle object) const
{
    char handle[24];
    std::snprintf(handle, sizeof handle, "0x%" PRIx64, object.handle);
    const std::string name = driver.report().nameOf(object.handle);
    return name.empty() ? handle : "\"" + name + "\" (" + handle + ")";
}

} // namespace vellum::layer
