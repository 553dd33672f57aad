// SPDX-License-Identifier: Apache-2.0
// Damage to the system by the bad drivers of fake_groups.cpp.
#pragma once

#include <string_view>

namespace vellum::test
{

void crash();
// Takes the files from it that pipes need.
void letParentStartNothing();
// Starts a process that keeps everything open and does not end by itself.
void leaveProcessBehind();
// Writes to the first descriptor after the standard streams, the one for a worker's events. Returns false if it is not
// open.
bool writeWhereEventsGo(std::string_view text);

} // namespace vellum::test
