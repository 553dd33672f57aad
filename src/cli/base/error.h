// What the command cannot do, in one line for its user.
#pragma once

#include <stdexcept>

namespace vellum::cli
{

class Error : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

} // namespace vellum::cli
