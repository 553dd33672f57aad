// SPDX-License-Identifier: Apache-2.0
// Preparation of a test process by calls of the operating system.
#pragma once

#include <string>

namespace vt
{

// May start the program again. `layerFolders`: as VK_ADD_LAYER_PATH has them.
void prepareProcess(char **argv, const std::string &layerFolders);

} // namespace vt
