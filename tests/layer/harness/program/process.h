// SPDX-License-Identifier: Apache-2.0
// What a process of tests needs of the operating system before anything else.
#pragma once

#include <string>

namespace vt
{

// May start the program again. `layerFolders`: as VK_ADD_LAYER_PATH has them.
void prepareProcess(char **argv, const std::string &layerFolders);

} // namespace vt
