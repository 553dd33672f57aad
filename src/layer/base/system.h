// SPDX-License-Identifier: Apache-2.0
// The layer's interface to the operating system. Texts and paths are UTF-8.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vellum::layer
{

// The value of an environment variable. Nothing in programs that run with more rights than their user has.
std::optional<std::string> environmentVariable(const std::string &name);
std::vector<std::string> environmentNames();

// The program and its process id, for messages of several processes in one place: "tests 1234".
std::string processName();

// The folder of this user for data that can be made again; empty if it is not known, and in programs that run with more
// rights than their user has.
std::string userCacheFolder();

// The vk_layer_settings.txt to read, found as Vulkan documents it for this system; empty if there is none. Settings may
// name files to write: a program with more rights than its user takes them from a file of the machine only. `report`
// gets a sentence about a VK_LAYER_SETTINGS_PATH that names nothing.
std::string settingsFile(const std::function<void(const std::string &)> &report);

// Appends to a regular file in one write, so that lines of several threads and processes do not mix. False if it
// cannot.
bool appendToFile(const std::string &file, std::string_view bytes);

// Stops in the debugger, or ends the program if there is none.
void stopInDebugger();

// Keeps this library loaded until the process ends. Loaders unload layers when the last instance is destroyed; a layer
// that is loaded again would have forgotten what it has printed, and lost what it never frees.
void stayLoaded();

// Zeroed memory at exactly this address; null if it is taken.
void *mapMemoryAt(void *address, size_t bytes);
void unmapMemory(void *address, size_t bytes);

} // namespace vellum::layer
