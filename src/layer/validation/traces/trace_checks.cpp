// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/traces/trace_checks.h"

#include <algorithm>
#include <cstring>

#include "layer/validation/gpu/serialized_data.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kMarks = 1u << 16;

// The rules of a geometry; nothing: not known yet.
std::optional<uint32_t> rulesBroken(const GeometryContents &geometry)
{
    if (!geometry.hasMicromap)
        return 0;
    const uint32_t micromap = kRuleMode | kRulePipelineBit | kRuleDisallowed;
    if (!geometry.indices.memory)
        return micromap;
    const std::optional<bool> mixed = geometry.indices.mixed();
    return mixed ? std::optional(micromap | (*mixed ? kRuleMixed : 0)) : std::nullopt;
}

// Returns whether rays meet instances with the mask. A cull mask that is computed has any bits, but is not 0.
bool meets(const TraceUse &use, uint32_t mask)
{
    return use.cullMask ? (mask & *use.cullMask) != 0 : mask == 0xff;
}
// Returns whether they may.
bool mayMeet(const TraceUse &use, uint32_t mask)
{
    return (mask & use.cullMask.value_or(0xff)) != 0;
}

std::optional<BrokenRules> brokenBy(const DeviceModel &device, const TraceUse &use)
{
    BrokenRules broken;
    if (!use.contents || !use.contents->instances.memory)
        return broken;
    const auto references = use.contents->instances.references();
    if (!references)
        return {};
    const std::span<const uint32_t> masks = use.contents->instances.masks();
    for (size_t i = 0; i < references->size(); ++i) {
        const VkDeviceAddress reference = meets(use, masks[i]) ? (*references)[i] : 0;
        const auto structure = reference != 0 ? device.objects.byReference.at(reference) : nullptr;
        const auto contents = structure ? structure->contents : nullptr;
        if (!contents || structure->since > use.number)
            continue; // unknown, or built again since
        if (contents->header) {
            if (contents->header->state() == SerializedHeader::State::NotRead)
                return {};
            std::string wrong = contents->header->state() == SerializedHeader::State::Read
                                    ? wrongMicromapOf(device, *contents, use.number)
                                    : std::string();
            if (!wrong.empty()) {
                broken.rules |= kRuleDeserialized;
                broken.deserialized = {structure, 0, std::move(wrong)};
            }
        }
        for (uint32_t g = 0; g < contents->geometries.size(); ++g) {
            const auto rules = rulesBroken(contents->geometries[g]);
            if (!rules)
                return {};
            if ((*rules & kRuleMode) != 0 && !broken.micromap.structure)
                broken.micromap = {structure, g};
            if ((*rules & kRuleMixed) != 0 && !broken.mixed.structure)
                broken.mixed = {structure, g};
            broken.rules |= *rules;
        }
    }
    return broken;
}

std::string structureText(const DeviceModel &device, const TraceUse &use, const MetGeometry &met)
{
    return "rays are traced in " + device.nameOf(use.structure->handle) + ", which has an instance of " +
           device.nameOf(met.structure->handle);
}

std::string geometryText(const DeviceModel &device, const TraceUse &use, const MetGeometry &met)
{
    return structureText(device, use, met) + "; its geometry " + std::to_string(met.index);
}

} // namespace

TraceMark::~TraceMark()
{
    marks_.giveBack(index_);
}

std::shared_ptr<const TraceMark> TraceMarks::add(const GpuContext &context, uint32_t rules)
{
    const std::lock_guard lock(mutex_);
    if (sites_.empty()) {
        free_.reserve(kMarks); // giving back does not fail
        constexpr VkDeviceSize kBytes = kMarks * sizeof(uint32_t);
        static_assert(kBytes % FixedMemory::kAlignment == 0);
        const bool isFixed = context.importsHostMemory && fixed_.reserve(kBytes) &&
                             memory_.createOn(context, fixed_.data(), kBytes) == VK_SUCCESS;
        if (!isFixed && memory_.create(context, kBytes) != VK_SUCCESS)
            return nullptr;
    }
    if (free_.empty() && sites_.size() == kMarks) // uncertain findings of destroyed shaders are dropped
        std::erase_if(watched_, [&](uint32_t mark) { return sites_[mark].unused && forget(mark); });
    if (free_.empty() && sites_.size() < kMarks) {
        sites_.emplace_back();
        free_.push_back(static_cast<uint32_t>(sites_.size() - 1));
    }
    if (free_.empty())
        return nullptr;
    auto mark = std::make_shared<const TraceMark>(*this, free_.back());
    free_.pop_back();
    Site &site = sites_[mark->index()];
    site = {};
    site.rules = rules;
    start(site);
    return mark;
}

void TraceMarks::giveBack(uint32_t index)
{
    const std::lock_guard lock(mutex_);
    if (sites_[index].watched)
        sites_[index].unused = true;
    else
        free_.push_back(index);
}

bool TraceMarks::forget(uint32_t index)
{
    Site &site = sites_[index];
    site.watched = false;
    site.uses.clear();
    if (site.unused)
        free_.push_back(index);
    return true;
}

void TraceMarks::start(Site &site) const
{
    site.broken = site.rules;
    site.frozen = false;
    site.first.reset();
    site.uses.clear();
    __atomic_store_n(memory_.words() + (&site - sites_.data()), 0u, __ATOMIC_RELEASE);
}

void TraceMarks::use(uint32_t mark, TraceUse use)
{
    const std::lock_guard lock(mutex_);
    Site &site = sites_[mark];
    if (site.frozen || site.reported)
        return;
    const bool known = std::ranges::any_of(site.uses, [&use](const TraceUse &other) {
        return other.contents == use.contents && other.structure == use.structure &&
               other.code.handle == use.code.handle;
    });
    if (!known)
        site.uses.push_back(std::move(use));
    if (site.watched)
        return;
    watched_.push_back(mark);
    site.watched = any_ = true;
}

bool TraceMarks::fold(const DeviceModel &device, Site &site)
{
    std::erase_if(site.uses, [&](const TraceUse &use) {
        const std::optional<BrokenRules> broken = brokenBy(device, use);
        if (!broken)
            return false;
        site.broken &= broken->rules;
        if (!site.first) {
            site.first = use;
            site.byFirst = *broken;
        }
        return true;
    });
    return site.uses.empty();
}

void TraceMarks::reportSite(DeviceModel &device, const Site &site)
{
    const TraceUse &use = *site.first;
    const BrokenRules &broken = site.byFirst;
    const std::string code = (use.shaderObject ? "shader object " : "pipeline ") + device.nameOf(use.code);
    const auto text = [&](const MetGeometry &met, const char *found, const char *expected) {
        return geometryText(device, use, met) + " " + found + ". " + code + " " + expected;
    };
    const auto fault = [&](const char *rule, const MetGeometry &met, const char *found, const char *expected) {
        const std::string vuid = std::string("VUID-") + use.command + rule;
        device.at(Place(use.command), use.code).report(vuid.c_str(), nullptr, text(met, found, expected));
    };
    const char *const withMicromap = "was built with a micromap";
    if ((site.broken & kRuleMode) != 0)
        fault("-micromap-11636", broken.micromap, withMicromap,
              "has a ray query there without the execution mode OpacityMicromapIdKHR; it must have the mode, with a "
              "true operand");
    if ((site.broken & kRulePipelineBit) != 0)
        fault("-micromap-11640", broken.micromap, withMicromap,
              "must have been created with RAY_TRACING_OPACITY_MICROMAP");
    if ((site.broken & kRuleMixed) != 0)
        fault(use.shaderObject ? "-micromap-11639" : "-micromap-11638", broken.mixed,
              "has special indices and indices of a micromap",
              "must not have been created with OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX");
    if ((site.broken & kRuleDeserialized) != 0) {
        const std::string vuid = std::string("VUID-") + use.command + "-micromap-11637";
        device.at(Place(use.command), broken.deserialized.structure->handle)
            .report(vuid.c_str(), nullptr,
                    structureText(device, use, broken.deserialized) + "; " + broken.deserialized.wrong);
    }
    if ((site.broken & kRuleDisallowed) != 0)
        device.at(Place(use.command), use.code)
            .report("VELLUM-pipeline-disallows-micromaps", nullptr,
                    text(broken.micromap, withMicromap, "was created with DISALLOW_OPACITY_MICROMAP_BIT_ARM"));
}

size_t TraceMarks::report(DeviceModel &device, bool idle)
{
    if (!any_ && !idle)
        return 0;
    size_t looked = 0;
    std::vector<Site> found;
    {
        const std::lock_guard submissions(device.logs.submissions); // change what structures hold
        const std::lock_guard lock(mutex_);
        looked = watched_.size();
        std::erase_if(watched_, [&](uint32_t index) {
            Site &site = sites_[index];
            site.frozen = site.frozen || __atomic_load_n(memory_.words() + index, __ATOMIC_ACQUIRE) != 0;
            const bool known = fold(device, site);
            if (site.frozen && known && site.first && site.broken != 0) {
                site.reported = true;
                found.push_back(site);
                return forget(index);
            }
            return known && (site.frozen || site.unused) && forget(index); // nothing more can become certain
        });
        for (Site &site : sites_)
            if (idle && (site.watched || site.frozen) && !site.reported)
                start(site);
        if (idle)
            std::erase_if(watched_, [&](uint32_t index) { return forget(index); });
        any_ = !watched_.empty();
    }
    for (const Site &site : found)
        reportSite(device, site);
    return looked;
}

// --- What was destroyed

namespace
{

struct LostPart {
    uint32_t instance = 0;
    LostStructures::Loss loss;
    std::shared_ptr<ValidatedStructure>
        structure{}; // the structure whose micromap was lost; null: the instance's structure was
    size_t geometry = 0;
};

// The first instance that rays may meet and whose structure, or a micromap of whose structure, is not valid then.
std::optional<LostPart> lostPart(const DeviceModel &device, const TraceUse &use, uint64_t built,
                                 std::span<const VkDeviceAddress> references)
{
    const LostStructures &lost = device.objects.lost;
    const std::span<const uint32_t> masks = use.contents->instances.masks();
    for (uint32_t i = 0; i < references.size(); ++i) {
        if (references[i] == 0 || !mayMeet(use, masks[i]))
            continue;
        const auto structure = device.objects.byReference.at(references[i]);
        if (!structure || structure->destroyed || lacksMemory(device, *structure)) {
            // A loss before the structure was built is a violation of the build.
            const auto loss = lost.byReference(references[i]);
            if (loss && loss->number > built && loss->number <= use.number)
                return LostPart{i, *loss};
            continue;
        }
        const auto contents = structure->contents;
        if (!contents) {
            if (structure->number < use.number && !isNotConstructed(device, *structure).empty())
                return LostPart{
                    i,
                    {.handle = structure->handle, .how = "was never built", .name = device.nameOf(structure->handle)}};
            continue;
        }
        if (structure->since > use.number)
            continue; // built again since
        for (size_t g = 0; g < contents->geometries.size(); ++g) {
            const uint64_t micromap = contents->geometries[g].micromapNumber;
            const auto loss = micromap != 0 ? lost.byNumber(micromap) : std::nullopt;
            if (loss && loss->number > structure->built && loss->number <= use.number)
                return LostPart{i, *loss, structure, g};
        }
    }
    return {};
}

void reportLost(const DeviceModel &device, const TraceUse &use, const std::string &text)
{
    const ObjectHandle structure = use.structure->handle;
    device.driver.report().warning("VELLUM-trace-invalid-structure",
                                   std::string(use.command) + ": " +
                                       (use.shaderObject ? "shader object " : "pipeline ") + device.nameOf(use.code) +
                                       " can trace rays in structure " + device.nameOf(structure) + ": " + text,
                                   structure.type, structure.handle);
}

} // namespace

void TracedStructures::use(DeviceModel &device, const TraceUse &use, bool isOrdered)
{
    ValidatedStructure &structure = *use.structure;
    const std::string found = isNotConstructed(device, structure);
    if (!found.empty() && isOrdered)
        return reportLost(device, use, found);
    const uint64_t losses = 1 + device.objects.lost.count(); // 0: instances were not checked
    const uint32_t cullMask = use.cullMask.value_or(0xff);
    if (structure.losses != losses)
        structure.checkedMask = 0;
    const bool isChecked = structure.losses == losses && (cullMask & ~structure.checkedMask) == 0;
    if (!use.contents || !use.contents->instances.memory || isChecked)
        return;
    structure.losses = losses;
    structure.checkedMask |= cullMask;
    const std::lock_guard lock(mutex_);
    traced_.push_back({use, structure.built});
    any_ = true;
}

void TracedStructures::check(const DeviceModel &device, const Traced &traced,
                             std::span<const VkDeviceAddress> references)
{
    const TraceUse &use = traced.use;
    const auto part = lostPart(device, use, traced.built, references);
    if (!part)
        return;
    const std::string what = part->structure
                                 ? "micromap " + part->loss.name + " of geometry " + std::to_string(part->geometry) +
                                       " of " + device.nameOf(part->structure->handle)
                                 : "structure " + part->loss.name;
    reportLost(device, use, what + ", of instance " + std::to_string(part->instance) + ", " + part->loss.how);
}

void TracedStructures::report(DeviceModel &device)
{
    if (!any_)
        return;
    const HeldMessages held;
    const std::lock_guard submissions(device.logs.submissions); // change what structures hold
    const std::lock_guard lock(mutex_);
    std::erase_if(traced_, [&](const Traced &traced) {
        const auto references = traced.use.contents->instances.references();
        if (references)
            check(device, traced, *references);
        return references.has_value();
    });
    any_ = !traced_.empty();
}

// --- Commands that may not be complete

void PendingTraces::add(const DeviceModel &device, TraceUse use, bool isOrdered)
{
    use.contents = use.structure->contents;
    if (use.batch != 0 && use.contents && use.contents->instances.memory)
        traces_[{use.contents.get(), use.queue}] = {use, isOrdered, device.objects.constructions};
}

void PendingTraces::forgetComplete(const DeviceModel &device, const IsPending &isPending)
{
    std::erase_if(traces_, [&](const auto &entry) {
        const Trace &trace = entry.second;
        if (isPending(trace.use.queue, trace.use.batch))
            return false;
        if (trace.constructions == device.objects.constructions)
            for (const auto &fault : trace.faults)
                fault();
        return true;
    });
}

std::optional<PendingTraces::Numbers> PendingTraces::reachedBy(const DeviceModel &device, const TraceUse &use)
{
    const auto references = use.contents->instances.references();
    if (!references)
        return {};
    Numbers reached;
    const auto add = [&reached](const ValidatedStructure &structure) {
        if (structure.buffer && !structure.byAddress)
            reached.insert(structure.buffer->number);
        return reached.insert(structure.number).second;
    };
    for (const VkDeviceAddress reference : *references) {
        const auto structure = reference != 0 ? device.objects.byReference.onlyAt(reference) : nullptr;
        if (!structure || structure->number > use.number || !add(*structure))
            continue;
        const auto contents = structure->contents;
        for (size_t g = 0; contents && structure->since <= use.number && g < contents->geometries.size(); ++g) {
            const auto micromap = contents->geometries[g].micromap.lock();
            if (micromap && !mayBeDiscardable(device, *micromap))
                add(*micromap);
        }
    }
    return reached;
}

void PendingTraces::check(const DeviceModel &device, const Place &command, const char *rule,
                          const ReferredObject &object, const IsPending &isPending)
{
    forgetComplete(device, isPending);
    for (auto &[key, trace] : traces_) {
        const TraceUse &use = trace.use;
        if (!trace.reached)
            trace.reached = reachedBy(device, use);
        if (!trace.reached || !trace.reached->contains(object.number))
            continue;
        const auto fault = [&device, rule, place = command.text(), object = object.handle,
                            text = device.nameOf(object.handle) + " is used by " + use.command +
                                   " (by way of top-level structure " + device.nameOf(use.structure->handle) +
                                   "), which is not known to be complete"] {
            device.at(Place(place), object).report(rule, nullptr, text);
        };
        return trace.isOrdered ? fault() : trace.faults.push_back(fault);
    }
}

// --- Commands

namespace
{

VkPipelineBindPoint pointOf(VkShaderStageFlagBits stage)
{
    return stage == VK_SHADER_STAGE_COMPUTE_BIT ? VK_PIPELINE_BIND_POINT_COMPUTE : VK_PIPELINE_BIND_POINT_GRAPHICS;
}

bool isKnown(VkPipelineBindPoint point)
{
    return point == VK_PIPELINE_BIND_POINT_GRAPHICS || point == VK_PIPELINE_BIND_POINT_COMPUTE ||
           point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR || point == VK_PIPELINE_BIND_POINT_SUBPASS_SHADING_HUAWEI;
}

bool mayBeUnused(const StructureSet &set, uint32_t binding)
{
    const auto known = set.bindings.find(binding);
    return known != set.bindings.end() && known->second.mayBeUnused;
}

// The command refers to the top-level structure, and to what is below it.
void refer(DeviceTraces &traces, const Submission &submission, const TraceUse &use)
{
    ValidatedStructure &structure = *use.structure;
    const CommandUse direct{.command = use.command, .subject = "top-level structure"};
    addUse(structure, submission, direct);
    if (structure.buffer) {
        CommandUse byBuffer = direct;
        byBuffer.address = structure.bufferAddress();
        addUse(*structure.buffer, submission, byBuffer);
    }
    traces.pending.add(traces.device, use, submission.ordered);
}

// A site of the code that a submitted command runs, with the set that was bound. What structures hold is unknown where
// the order of submissions is.
void useSite(DeviceTraces &traces, const TracingSite &site, const StructureSet *set, const Submission &submission,
             TraceUse use)
{
    use.number = ++traces.device.numbers;
    use.queue = submission.queue;
    use.batch = submission.batch;
    const auto useStructure = [&](const std::shared_ptr<ValidatedStructure> &structure) {
        use.contents = structure && submission.ordered ? structure->contents : nullptr;
        use.structure = structure;
        if (structure && site.binding.element) { // of several, the shader may use others
            traces.traced.use(traces.device, use, submission.ordered);
            if (!mayBeUnused(*set, site.binding.binding))
                refer(traces, submission, use);
        }
        if (site.mark)
            traces.marks.use(site.mark->index(), use);
    };
    const auto structures =
        set ? traces.device.objects.descriptors.structures(*set, site.binding.binding, site.binding.element)
            : StructurePointers{};
    for (const auto &structure : structures)
        useStructure(structure);
    if (structures.empty())
        useStructure(nullptr);
}

constexpr uint32_t kGroupSize = 64;

// Records a shader that reads what a build accesses, and writes what it finds to the memory in the end.
template <typename Push>
void capture(DeviceModel &device, VkCommandBuffer commandBuffer, InjectedShader shader, const Push &push)
{
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    work.dispatch(shader, push, push.count, kGroupSize);
    work.barrier(true);
}

CapturedInstances captureInstances(DeviceModel &device, VkCommandBuffer commandBuffer, const input::Access &access,
                                   const VkAccelerationStructureGeometryInstancesDataKHR &instances, uint32_t count)
{
    auto memory = Capture::make(device.captureMemory, Capture::kCountWords + size_t{count} * CapturedInstances::kWords,
                                Capture::kCountWords);
    if (!memory)
        return {};
    capture(device, commandBuffer, InjectedShader::InstancesContents,
            shared::InstancesContentsPush{.source = access.begin(),
                                          .target = memory->address(),
                                          .count = count,
                                          .pointers = instances.arrayOfPointers ? 1u : 0u});
    return {count, std::move(memory)};
}

CapturedIndices captureIndices(DeviceModel &device, VkCommandBuffer commandBuffer, const input::Access &access,
                               const input::Attachment &attachment, uint32_t count)
{
    auto memory = Capture::make(device.captureMemory, Capture::kCountWords, Capture::kCountWords);
    if (!memory)
        return {};
    capture(device, commandBuffer, InjectedShader::IndexKinds,
            shared::IndexKindsPush{.source = access.begin(),
                                   .target = memory->address(),
                                   .stride = static_cast<uint32_t>(attachment.indexStride),
                                   .count = count,
                                   .bytes = input::indexBytes(attachment.indexType),
                                   .unused = 0});
    return {count, std::move(memory)};
}

} // namespace

void bindTracingPipeline(DeviceTraces &traces, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                         VkPipeline pipeline)
{
    if (!traces.device.checks.gpu || !isKnown(point))
        return;
    const auto log = traces.device.logs.get(commandBuffer);
    if (!log)
        return;
    auto &code = log->traces.at(point).code;
    code.clear();
    if (auto bound = traces.pipelines.get(pipeline))
        code[0] = std::move(bound);
}

void bindTracingShaders(DeviceTraces &traces, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders)
{
    const auto log = traces.device.checks.gpu ? traces.device.logs.get(commandBuffer) : nullptr;
    for (uint32_t i = 0; log && i < count; ++i) {
        auto &code = log->traces.at(pointOf(stages[i])).code;
        code.erase(0);
        code.erase(stages[i]);
        if (auto bound = shaders ? traces.shaders.get(shaders[i]) : nullptr)
            code[stages[i]] = std::move(bound);
    }
}

void runTracing(DeviceTraces &traces, VkCommandBuffer commandBuffer, VkPipelineBindPoint point, const char *command)
{
    const auto log = traces.device.checks.gpu && isKnown(point) ? traces.device.logs.get(commandBuffer) : nullptr;
    if (!log)
        return;
    PointBindings &bindings = log->traces.at(point);
    for (const auto &[stage, tracing] : bindings.code) {
        for (const TracingSite &site : tracing->sites) {
            const auto bound = bindings.sets.find(site.binding.set);
            auto set = bound == bindings.sets.end() ? nullptr : bound->second;
            traces.device.logs.add(commandBuffer,
                                   [&traces, &site, command, code = tracing, set](const Submission &submission) {
                                       useSite(traces, site, set.get(), submission,
                                               {.command = command,
                                                .code = code->handle,
                                                .shaderObject = code->shaderObject,
                                                .cullMask = site.cullMask,
                                                .structure = {},
                                                .contents = {}});
                                   });
        }
    }
}

void captureContents(DeviceModel &device, VkCommandBuffer commandBuffer, const input::StructureBuild &build,
                     StructureContents &contents)
{
    const CommandState *state = device.commands.states.get(commandBuffer);
    // In a command buffer that inherits conditional rendering, dispatches may be discarded.
    if (!device.checks.gpu || !state || state->inheritsConditionalRendering)
        return;
    for (const input::Access &access : build.accesses) {
        const uint32_t g = access.geometry;
        // Other rules are about what is outside of buffers.
        if (access.bytes == 0 || g >= contents.geometries.size() ||
            !device.buffers.addresses.covering(access.begin(), access.bytes, 0).buffer)
            continue;
        const input::Geometry &geometry = build.geometries[g];
        const uint32_t count = build.ranges.primitives(g);
        if (access.of == input::Access::Of::Instances && !build.hasMotion()) // as in the check of instances
            contents.instances =
                captureInstances(device, commandBuffer, access, geometry.given->geometry.instances, count);
        else if (access.of == input::Access::Of::MicromapIndices && geometry.attachment->micromap)
            contents.geometries[g].indices = captureIndices(device, commandBuffer, access, *geometry.attachment, count);
    }
}

} // namespace vellum::layer
