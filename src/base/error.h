// SPDX-License-Identifier: Apache-2.0
// Errors of the command, each in one line for its user.
#pragma once

#include <stdexcept>

namespace vellum
{

class Error : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

// An invalid command line: ExitCode::Usage.
class UsageError : public Error
{
public:
    using Error::Error;
};

} // namespace vellum
