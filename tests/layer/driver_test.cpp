// What a driver may do that lavapipe does not, and what must not reach it: spy_layer.cpp is that driver.
#include <cstdlib>

#include "scene.h"

namespace
{

using namespace vt;

// An environment variable for as long as this lives.
class Environment
{
public:
    explicit Environment(const char *name) : name_(name) { setenv(name, "1", 1); }
    ~Environment() { unsetenv(name_); }
    Environment(const Environment &) = delete;
    Environment &operator=(const Environment &) = delete;

private:
    const char *name_;
};

// Of memory that is local to the device and visible to the host there is little, on some: the layer's tables go
// elsewhere then.
TEST(Driver, WithoutLocalMemoryLeft)
{
    std::unique_ptr<Gpu> gpu;
    {
        const Environment full("VELLUM_TEST_SPY_MEMORY");
        ASSERT_NO_THROW(gpu = std::make_unique<Gpu>());
    }
    for (const Message &m : gpu->takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

} // namespace
