// SPDX-License-Identifier: Apache-2.0
#include "cli/check/runner.h"

#include <algorithm>
#include <csignal>
#include <limits>
#include <memory>
#include <utility>

#include "cli/base/error.h"
#include "cli/base/interrupt.h"
#include "cli/check/worker_process.h"

namespace vellum::cli
{
namespace
{

using Clock = std::chrono::steady_clock;

constexpr int kMillisecondsOfWaiting = 20;

double since(Clock::time_point begin)
{
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

std::vector<std::string> with(std::vector<std::string> options, check::Api api)
{
    options.insert(options.end(), {"--api", nameOf(api)});
    return options;
}

// The failed assertion that a driver printed; empty if there is none.
std::string assertionIn(const std::string &printed)
{
    for (const char *word : {"Assertion ", "assertion "}) {
        const size_t at = printed.rfind(word);
        if (at == std::string::npos)
            continue;
        const size_t line = printed.rfind('\n', at);
        const size_t begin = line == std::string::npos ? 0 : line + 1;
        return printed.substr(begin, printed.find('\n', at) - begin);
    }
    return {};
}

// Of a worker that ended in a case.
std::string causeOfEnd(const std::string &ending, const std::string &printed)
{
    const std::string assertion = assertionIn(printed);
    return (ending.empty() ? "exit code 0" : ending) + (assertion.empty() ? "" : ": " + assertion);
}

check::Outcome outcomeOf(check::Status status, std::string cause, const std::string &printed)
{
    check::Outcome outcome;
    outcome.status = status;
    outcome.cause = std::move(cause);
    if (printed.empty())
        return outcome;
    outcome.detail = "The last output was:\n";
    for (const char c : printed)
        outcome.detail += (c >= ' ' && c <= '~') || c == '\n' || c == '\t' ? c : '?';
    return outcome;
}

// A write to a worker that has ended fails instead of ending this process.
class IgnoredPipeSignal
{
public:
    IgnoredPipeSignal() : before_(std::signal(SIGPIPE, SIG_IGN)) {}
    ~IgnoredPipeSignal() { std::signal(SIGPIPE, before_); }
    IgnoredPipeSignal(const IgnoredPipeSignal &) = delete;
    IgnoredPipeSignal &operator=(const IgnoredPipeSignal &) = delete;

private:
    void (*before_)(int);
};

} // namespace

std::string causeOf(const check::Outcome &outcome)
{
    return nameOf(outcome.status) + (outcome.cause.empty() ? "" : ": " + outcome.cause);
}

// A worker process at a time, and the case that it runs.
class Runner::Slot
{
public:
    explicit Slot(Runner &runner) : runner_(runner) {}

    // Starts what can be started. Returns whether there is something to wait for.
    bool proceed(Schedule &schedule);
    // Looks at what has come.
    void check();
    // Reports what is known, at an interruption.
    void stop();
    [[nodiscard]] const WorkerProcess *process() const { return process_.get(); }

private:
    void begin(const CaseId &id);
    void handle(const Event &event);
    void fail(check::Status status, std::string cause);
    void finish(check::Outcome outcome);
    void close(); // the device
    void closed(check::Status status, const std::string &how);
    void drop(); // the process
    void leaveStream();
    void reportHeld();

    Runner &runner_;
    std::unique_ptr<WorkerProcess> process_;
    Stream *stream_ = nullptr;
    Clock::time_point turnBegan_;
    std::optional<CaseId> current_;
    bool open_ = false; // the device
    bool closing_ = false;
    Clock::time_point waitingSince_; // for the next event of the worker
    // A result of this process that a crash at its end may still change.
    std::optional<Finished> held_;
    // A failure, until its case has been run again.
    std::optional<Finished> failure_;
};

bool Runner::Slot::proceed(Schedule &schedule)
{
    if (current_ || closing_)
        return true;
    if (failure_) {
        begin(failure_->id);
        return true;
    }
    const bool end = runner_.timeIsOver() || runner_.givesUp();
    if (stream_ != nullptr && (end || (runner_.turn_ > 0 && since(turnBegan_) > runner_.turn_)))
        leaveStream();
    if (stream_ != nullptr) {
        if (const std::optional<CaseId> id = runner_.nextOf(*stream_)) {
            begin(*id);
            return true;
        }
        leaveStream();
    }
    if (process_ != nullptr) {
        close();
        return true;
    }
    if (end)
        return false;
    stream_ = schedule.choose();
    if (stream_ == nullptr)
        return false;
    ++stream_->workers;
    turnBegan_ = Clock::now();
    return true;
}

void Runner::Slot::begin(const CaseId &id)
{
    if (process_ == nullptr) {
        process_ = std::make_unique<WorkerProcess>(with(runner_.settings_.workerOptions, id.api));
        open_ = false;
    }
    current_ = id;
    waitingSince_ = Clock::now();
    const bool replays = !runner_.settings_.replay.empty();
    process_->send({replays ? Request::Kind::Replay : Request::Kind::Run, std::string(id.group->name),
                    seedOf(runner_.settings_.seed, id), runner_.settings_.replay});
}

void Runner::Slot::check()
{
    if (process_ == nullptr)
        return;
    const std::optional<std::string> ending = process_->ending(); // first: what was written before it is read below
    const std::vector<Event> events = process_->read();
    for (const Event &event : events)
        handle(event);
    const bool late = (current_ || closing_) && since(waitingSince_) > runner_.settings_.timeout;
    if (process_ == nullptr || (!ending && !late))
        return;
    const check::Status status = ending ? check::Status::Crash : check::Status::Timeout;
    if (current_)
        fail(status, ending ? causeOfEnd(*ending, process_->printed()) : "");
    else
        closed(status, ending.value_or("timeout"));
    drop();
}

void Runner::Slot::handle(const Event &event)
{
    if (!current_)
        return;
    switch (event.kind) {
    case Event::Kind::Device: break;
    case Event::Kind::Begin:
        open_ = true;
        runner_.failedOpenings_ = 0;
        waitingSince_ = Clock::now();
        break;
    case Event::Kind::End:
        finish(event.outcome);
        // The driver is of no use after that.
        if (event.outcome.status == check::Status::DeviceLost)
            drop();
        break;
    case Event::Kind::Error:
        fail(check::Status::Crash, event.message);
        drop();
        break;
    }
}

void Runner::Slot::fail(check::Status status, std::string cause)
{
    if (!open_) {
        ++runner_.failedOpenings_;
        cause = "the device cannot be opened" + (cause.empty() ? "" : ": " + cause);
    }
    finish(outcomeOf(status, std::move(cause), process_->printed()));
}

void Runner::Slot::finish(check::Outcome outcome)
{
    reportHeld();
    const CaseId id = *std::exchange(current_, std::nullopt);
    const double seconds = since(waitingSince_);
    if (stream_ != nullptr)
        stream_->note(outcome.status, seconds);
    const Verdict verdict = runner_.expectations_.verdictOn(nameOf(id), outcome.status);
    if (failure_) {
        if (isSuccess(verdict))
            failure_->verdict = Verdict::Flake;
        else
            ++runner_.confirmed_[causeOf(failure_->outcome)];
        runner_.report_(*std::exchange(failure_, std::nullopt));
        return;
    }
    Finished finished{id, std::move(outcome), verdict, seconds};
    if (runner_.mustConfirm(finished)) {
        failure_ = std::move(finished);
        if (open_ && failure_->outcome.status == check::Status::Fail)
            close(); // another process runs it again
        return;
    }
    held_ = std::move(finished);
}

void Runner::Slot::close()
{
    process_->endRequests();
    closing_ = true;
    waitingSince_ = Clock::now();
}

// The worker has ended after its last case, or does not end.
void Runner::Slot::closed(check::Status status, const std::string &how)
{
    if (held_ && isSuccess(held_->verdict) && !how.empty()) {
        held_->outcome = outcomeOf(status, how + " when the device was closed", process_->printed());
        held_->verdict = runner_.expectations_.verdictOn(nameOf(held_->id), status);
    }
}

void Runner::Slot::drop()
{
    process_.reset();
    closing_ = false;
    reportHeld();
}

void Runner::Slot::leaveStream()
{
    --stream_->workers;
    stream_ = nullptr;
}

void Runner::Slot::reportHeld()
{
    if (held_)
        runner_.report_(*std::exchange(held_, std::nullopt));
}

void Runner::Slot::stop()
{
    process_.reset();
    reportHeld();
    if (failure_)
        runner_.report_(*std::exchange(failure_, std::nullopt));
}

Runner::Runner(RunSettings settings, const Expectations &expectations, std::function<void(const Finished &)> report,
               std::function<void()> tick)
    : settings_(std::move(settings)), expectations_(expectations), tick_(std::move(tick))
{
    report_ = [this, report = std::move(report)](const Finished &finished) {
        failed_ |= !isSuccess(finished.verdict);
        report(finished);
    };
}

double Runner::seconds() const
{
    return since(start_);
}

std::optional<CaseId> Runner::nextOf(Stream &stream)
{
    while (!stream.atEnd()) {
        const CaseId id = stream.next();
        if (!expectations_.skips(nameOf(id)))
            return id;
        report_({id, outcomeOf(check::Status::Skip, "by --skips", ""), Verdict::Skip, 0});
    }
    return std::nullopt;
}

bool Runner::mustConfirm(const Finished &finished) const
{
    if (isSuccess(finished.verdict) || !settings_.replay.empty())
        return false;
    const auto confirmed = confirmed_.find(causeOf(finished.outcome));
    return confirmed == confirmed_.end() || confirmed->second < kMostConfirmations;
}

void Runner::reportMissing(Schedule &schedule)
{
    while (Stream *stream = schedule.choose())
        if (const std::optional<CaseId> id = nextOf(*stream))
            report_({*id, outcomeOf(check::Status::Crash, "the device cannot be opened", ""), Verdict::Missing, 0});
}

void Runner::run(Schedule &schedule)
{
    const IgnoredPipeSignal ignored;
    start_ = Clock::now();
    if (settings_.budget && schedule.streams() != 0) {
        schedule.shareTime();
        turn_ = std::clamp(*settings_.budget * settings_.jobs / static_cast<double>(2 * schedule.streams()), 1.0, 30.0);
    }
    std::vector<std::unique_ptr<Slot>> slots;
    for (unsigned i = 0; i < settings_.jobs; ++i)
        slots.push_back(std::make_unique<Slot>(*this));
    for (bool busy = true; busy && !Interruptible::interrupted() && !(settings_.failFast && failed_);) {
        busy = false;
        std::vector<const WorkerProcess *> processes;
        for (const auto &slot : slots) {
            busy |= slot->proceed(schedule);
            if (slot->process() != nullptr)
                processes.push_back(slot->process());
        }
        if (!processes.empty())
            waitForAny(processes, kMillisecondsOfWaiting);
        for (const auto &slot : slots)
            slot->check();
        tick_();
    }
    for (const auto &slot : slots)
        slot->stop();
    if (givesUp() && !settings_.budget)
        reportMissing(schedule);
}

DeviceSummary askForDevice(const std::vector<std::string> &workerOptions, double timeout)
{
    const IgnoredPipeSignal ignored;
    const Clock::time_point begin = Clock::now();
    WorkerProcess worker(workerOptions);
    worker.send({Request::Kind::Describe, {}, 0, {}});
    while (since(begin) < timeout && !Interruptible::interrupted()) {
        waitForAny({&worker}, kMillisecondsOfWaiting);
        const std::optional<std::string> ending = worker.ending();
        for (const Event &event : worker.read()) {
            if (event.kind == Event::Kind::Error)
                throw Error(event.message);
            if (event.kind == Event::Kind::Device)
                return event.device;
        }
        if (ending)
            throw Error("listing the Vulkan devices failed: " + *ending);
    }
    throw Error("listing the Vulkan devices takes too long");
}

} // namespace vellum::cli
