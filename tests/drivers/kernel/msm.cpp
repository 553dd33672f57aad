// SPDX-License-Identifier: Apache-2.0
#include "msm.h"

#include <cerrno>

#include "msm_interface.h"

namespace vellum::test::kernel::msm
{
namespace
{

struct Gpu {
    const char *name;
    u64 chip; // generation, major, minor and patch, a byte each
};

constexpr Gpu kGpus[]{
    {"a740", 0x43050a01},
    {"a750", 0x43051401},
};

class Msm : public KernelDriver
{
public:
    Msm(const Gpu &gpu, Objects &objects, SyncObjects &syncs) : KernelDriver(objects, syncs), gpu_(gpu) {}

    [[nodiscard]] Identity identity() const override { return {"msm", 1, 12, 0x5143, 0, 0}; }

    int call(unsigned number, void *argument) override
    {
        switch (Call{number}) {
        case Call::Parameter: return parameter(*static_cast<Parameter *>(argument));
        case Call::CreateObject: {
            auto *object = static_cast<CreateObject *>(argument);
            return objects().create(object->size, object->handle);
        }
        case Call::ObjectInfo: {
            auto *info = static_cast<ObjectInfo *>(argument);
            // Names, addresses and metadata of objects are only taken.
            return info->name == InfoName::Offset ? objects().offset(info->handle, info->value) : 0;
        }
        case Call::Submit: return submit(*static_cast<Submit *>(argument));
        case Call::Advise: static_cast<Advise *>(argument)->retained = 1; return 0;
        case Call::CreateQueue: static_cast<CreateQueue *>(argument)->id = objects().newHandle(); return 0;
        case Call::WaitFence: // nothing is under way
        case Call::CloseQueue: return 0;
        }
        return EINVAL;
    }

private:
    int parameter(Parameter &parameter) const
    {
        const auto value = [this](ParameterName name) -> u64 {
            switch (name) {
            case ParameterName::ChipId: return gpu_.chip;
            case ParameterName::OnChipBytes: return 3 << 20;
            case ParameterName::Priorities: return 3;
            case ParameterName::AddressBegin: return u64{1} << 32;
            case ParameterName::AddressBytes: return u64{1} << 40;
            case ParameterName::HighestBankBit: return 16;
            case ParameterName::Raytracing: return 1;
            case ParameterName::BandwidthSwizzle: return 6;
            case ParameterName::MacrotileMode: return 1;
            case ParameterName::TrapBase: return 0x1fffffffff000;
            case ParameterName::GpuId: // chips of this generation have none
            case ParameterName::OnChipBase:
            case ParameterName::Timestamp:
            case ParameterName::Faults:
            case ParameterName::Suspends: break;
            }
            return 0;
        };
        parameter.value = value(parameter.name);
        return 0;
    }

    // Submitted work completes at once.
    int submit(Submit &submit)
    {
        for (const SubmittedSync &signal : array<SubmittedSync>(submit.signals, submit.signalCount)) {
            if (const int error = syncs().signal(signal.handle, signal.point == 0 ? 1 : signal.point))
                return error;
        }
        submit.fence = ++submissions_;
        return 0;
    }

    const Gpu &gpu_;
    u32 submissions_ = 0;
};

} // namespace

std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs)
{
    for (const Gpu &one : kGpus) {
        if (gpu == one.name)
            return std::make_unique<Msm>(one, objects, syncs);
    }
    return nullptr;
}

} // namespace vellum::test::kernel::msm
