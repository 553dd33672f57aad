// SPDX-License-Identifier: Apache-2.0
// The parts of the micromap fuzz target.
#pragma once

namespace vellum::fuzz
{

class Reader;

// The build of a micromap in memory (core/micromap_memory.h), and damaged records.
void buildMemory(Reader &input);
// Micromaps as plain data (core/micromap.h).
void model(Reader &input);
// The host commands of the layer, on a device that consists of a memory to map.
void hostCommands(Reader &input);

} // namespace vellum::fuzz
