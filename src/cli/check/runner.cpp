// SPDX-License-Identifier: Apache-2.0
#include "cli/check/runner.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/process.h"

namespace vellum::cli
{
namespace
{

using Clock = std::chrono::steady_clock;

constexpr int kMillisecondsOfWaiting = 20;
constexpr double kSecondsBetweenStarts = 0.5;
constexpr uint32_t kShrinkSeconds = 30;

double since(Clock::time_point begin)
{
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

// The line by which the layer reports a setting that it ignores; empty if there is none.
std::string settingFaultIn(const std::string &printed)
{
    const size_t begin = printed.find("VELLUM-setting: ");
    return begin == std::string::npos ? std::string() : printed.substr(begin, printed.find('\n', begin) - begin);
}

} // namespace

std::string causeOf(const check::Outcome &outcome)
{
    return nameOf(outcome.status) + (outcome.cause.empty() ? "" : ": " + outcome.cause);
}

std::vector<EarlierCase> earlierCases(const std::vector<CaseId> &cases, uint64_t seed)
{
    std::vector<EarlierCase> earlier;
    for (const CaseId &id : cases)
        earlier.push_back({nameOf(id), std::string(id.group->name), seedOf(seed, id)});
    return earlier;
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
    // Null without a worker.
    [[nodiscard]] const ChildProcess *process() const { return process_ ? &process_->process() : nullptr; }

private:
    void begin(const CaseId &id);
    void requestRun(); // a worker for current_
    void startWaiting();
    void abandon();
    void handle(const Event &event);
    void fail(check::Status status, std::string cause);
    void finish(check::Outcome outcome, size_t before = 0);
    void close(); // the device
    void closed(check::Status status, const std::string &how);
    void drop(); // the process
    void leaveStream();
    void reportHeld();

    Runner &runner_;
    std::unique_ptr<WorkerProcess> process_;
    Stream *stream_ = nullptr;
    Clock::time_point turnBegan_;
    std::optional<CaseId> current_; // without a process: none could be started so far
    Clock::time_point lastStart_;
    bool open_ = false; // the device
    bool closing_ = false;
    bool separate_ = false;          // the last request was a Request::Separate
    Clock::time_point waitingSince_; // for the next event of the worker
    double limit_ = 0;               // of waiting, in seconds
    // A result of this process that a crash at its end may still change.
    std::optional<Finished> held_;
    // A failure, until its case has been run again.
    std::optional<Finished> failure_;
    std::vector<CaseId> before_; // the cases before it in its process
    std::vector<CaseId> ran_;    // cases of this process, current_ last
};

bool Runner::Slot::proceed(Schedule &schedule)
{
    if (current_ && process_ == nullptr) {
        if (runner_.givesUp())
            abandon();
        else if (since(lastStart_) > kSecondsBetweenStarts)
            requestRun();
    }
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
    current_ = id;
    requestRun();
}

void Runner::Slot::requestRun()
{
    const RunSettings &settings = runner_.settings_;
    const CaseId &id = *current_;
    if (process_ == nullptr) {
        WorkerOptions options = settings.worker;
        options.api = id.api;
        lastStart_ = Clock::now();
        try {
            process_ = std::make_unique<WorkerProcess>(options);
        } catch (const Error &error) { // a limit of processes or of files
            runner_.noteFailedStart(error.what(), lastStart_);
            return;
        }
        ++runner_.workers_;
        open_ = false;
        ran_.clear();
    }
    startWaiting();
    limit_ = settings.timeout;
    Request request{.group = std::string(id.group->name), .seed = seedOf(settings.seed, id)};
    if (!settings.replay.empty()) {
        request.kind = Request::Kind::Replay;
        request.reproducer = settings.replay;
    } else if (failure_ && failure_->outcome.status != check::Status::Fail) {
        request.kind = Request::Kind::Separate;
        request.timeout = static_cast<uint32_t>(std::ceil(settings.timeout));
        request.shrinkSeconds = runner_.confirmed_.contains(causeOf(failure_->outcome)) ? 0 : kShrinkSeconds;
        // Besides the time limits of its own: making the case, running it, running it once more in the end, and the
        // cases before it.
        limit_ = static_cast<double>(4 + before_.size()) * settings.timeout + request.shrinkSeconds;
        if (!before_.empty())
            request.reproducer = write(Reproducer{.name = nameOf(id),
                                                  .api = id.api,
                                                  .group = request.group,
                                                  .seed = request.seed,
                                                  .before = earlierCases(before_, settings.seed)});
    }
    ran_.push_back(id);
    separate_ = request.kind == Request::Kind::Separate;
    process_->send(request);
}

void Runner::Slot::startWaiting()
{
    waitingSince_ = Clock::now();
    process_->startWaiting();
}

// Marks that no worker runs current_.
void Runner::Slot::abandon()
{
    const CaseId id = *std::exchange(current_, std::nullopt);
    if (failure_)
        runner_.report_(*std::exchange(failure_, std::nullopt));
    else
        runner_.reportMissing(id);
}

void Runner::Slot::check()
{
    if (process_ == nullptr)
        return;
    const auto [events, end] = process_->read();
    for (const Event &event : events)
        handle(event);
    const bool late = (current_ || closing_) && process_ != nullptr && process_->isLate(limit_);
    if (process_ == nullptr || (!end && !late))
        return;
    const check::Status status = end ? check::Status::Crash : check::Status::Timeout;
    if (current_)
        fail(status, end ? process_->causeOf(*end) : "");
    else
        closed(status, end ? end->text() : "timeout");
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
        startWaiting();
        break;
    case Event::Kind::End:
        finish(event.outcome, event.before);
        // The driver is of no use after a lost device, and its worker has not opened it for a separate run.
        if (event.outcome.status == check::Status::DeviceLost || separate_)
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
        runner_.whyMissing_ = "the device cannot be opened";
        cause = runner_.whyMissing_ + (cause.empty() ? "" : ": " + cause);
    }
    finish(outcomeOfEnd(status, std::move(cause), process_->printed()));
}

void Runner::Slot::finish(check::Outcome outcome, size_t before)
{
    reportHeld();
    const CaseId id = *std::exchange(current_, std::nullopt);
    const double seconds = since(waitingSince_);
    if (stream_ != nullptr && failure_)
        stream_->noteRepeated(seconds);
    else if (stream_ != nullptr)
        stream_->note(outcome.status, seconds);
    const Verdict verdict = runner_.expectations_.verdictOn(nameOf(id), outcome.status);
    if (failure_) {
        if (isSuccess(verdict))
            failure_->verdict = Verdict::Flake;
        else
            ++runner_.confirmed_[causeOf(failure_->outcome)];
        if (separate_ && !outcome.reproducer.empty()) {
            failure_->outcome.reproducer = std::move(outcome.reproducer);
            failure_->outcome.files = std::move(outcome.files);
        }
        if (separate_ && before > 0 && before <= before_.size()) {
            failure_->before.assign(before_.end() - static_cast<ptrdiff_t>(before), before_.end());
            failure_->outcome.files = std::move(outcome.files);
            failure_->outcome.detail =
                "It fails only after these cases in the same process, which --replay of its file runs first: " +
                namesOf(earlierCases(failure_->before, runner_.settings_.seed)) +
                (failure_->outcome.detail.empty() ? "" : "\n" + failure_->outcome.detail);
        }
        runner_.report_(*std::exchange(failure_, std::nullopt));
        return;
    }
    Finished finished{id, std::move(outcome), verdict, seconds};
    if (runner_.mustConfirm(finished)) {
        failure_ = std::move(finished);
        before_ = {ran_.begin(), ran_.end() - 1};
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
    startWaiting();
    limit_ = runner_.settings_.timeout;
}

// The worker has ended after its last case, or does not end.
void Runner::Slot::closed(check::Status status, const std::string &how)
{
    if (held_ && isSuccess(held_->verdict) && !how.empty()) {
        held_->outcome = outcomeOfEnd(status, how + " when the device was closed", process_->printed());
        held_->verdict = runner_.expectations_.verdictOn(nameOf(held_->id), status);
    }
}

void Runner::Slot::drop()
{
    process_.reset();
    --runner_.workers_;
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
        failed_ |= failsRun(finished.verdict, settings_.failOnFlake);
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
        report_({id, outcomeOfEnd(check::Status::Skip, "by --skips", ""), Verdict::Skip, 0});
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

// If other workers run, this failure to start is due to a lack of resources, so the run continues. Slots that fail at
// the same time count as one.
void Runner::noteFailedStart(const std::string &error, Clock::time_point time)
{
    if (workers_ != 0 || std::chrono::duration<double>(time - lastFailedStart_).count() <= kSecondsBetweenStarts)
        return;
    lastFailedStart_ = time;
    ++failedOpenings_;
    whyMissing_ = "no worker can be started: " + error;
}

void Runner::reportMissing(const CaseId &id)
{
    report_({id, outcomeOfEnd(check::Status::Crash, whyMissing_, ""), Verdict::Missing, 0});
}

void Runner::run(Schedule &schedule)
{
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
        std::vector<const ChildProcess *> processes;
        for (const auto &slot : slots) {
            busy |= slot->proceed(schedule);
            if (slot->process() != nullptr)
                processes.push_back(slot->process());
        }
        if (busy)
            ChildProcess::waitForAny(processes, kMillisecondsOfWaiting);
        for (const auto &slot : slots)
            slot->check();
        tick_();
    }
    for (const auto &slot : slots)
        slot->stop();
    if (!givesUp() || settings_.budget)
        return;
    while (Stream *stream = schedule.choose())
        if (const std::optional<CaseId> id = nextOf(*stream))
            reportMissing(*id);
}

DeviceSummary findDevice(const WorkerOptions &options, double timeout)
{
    WorkerProcess worker(options);
    worker.send({.kind = Request::Kind::Describe});
    const Answer answer = waitForAnswer(worker, timeout);
    if (!answer.event)
        throw Error(answer.end ? "listing the Vulkan devices failed: " + answer.end->text()
                               : "listing the Vulkan devices takes too long");
    if (answer.event->kind == Event::Kind::Error)
        throw Error(answer.event->message);
    if (const std::string fault = settingFaultIn(worker.printed()); !fault.empty())
        throw UsageError(fault);
    return answer.event->device;
}

} // namespace vellum::cli
