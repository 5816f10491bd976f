#include <ise/service/action_runs.hpp>

#include <ise/call/provide.hpp>
#include <ise/core/little_endian.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/service/run_tap.hpp>
#include <ise/session/service_runtime.hpp>
#include <ise/wire/reason.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <exception>
#include <vector>

namespace ise {
namespace {

// Runs that were here: a goal that comes again so late is not executed a second time.
constexpr std::size_t remembered = 1024;

// The alternatives of an update.
constexpr std::byte a_report{0}, a_result{1}, a_failure{2};

bytes update_of(std::byte kind, bytes_view packet) {
    bytes made(1 + packet.size());
    made.front() = kind;
    std::ranges::copy(packet, made.begin() + 1);
    return made;
}

bytes encoded(const failure& why) {
    run_failure result;
    result.code = static_cast<std::uint8_t>(why.code());
    result.execution = static_cast<std::uint8_t>(why.executed());
    result.reason = wire::reason_of(why.message());
    return encode(result);
}

} // namespace

provided_run::provided_run(std::weak_ptr<action_runs> of, loop& on)
    : owner(std::move(of)), deadline(on, [this] {
          if (auto here = owner.lock()) here->on_deadline(*this);
      }) {}

action_runs::action_runs(service_runtime& runtime, std::string name, action_options options, executor execute)
    : runtime_(runtime), name_(std::move(name)), options_(options), execute_(std::move(execute)) {
    options_.concurrent = std::max<std::size_t>(options_.concurrent, 1);
}

std::shared_ptr<publication_core> action_runs::make(service_runtime& runtime, std::string name,
                                                    const packet_types& types, action_options options,
                                                    executor execute) {
    std::shared_ptr<action_runs> runs(new action_runs(runtime, name, options, std::move(execute)));
    auto out = std::make_shared<publication_core>(runtime, std::move(name), types);
    runs->out_ = out;
    out->accept = [runs](bytes_view request, const adapter* adapt, const subscriber_info& who) {
        return runs->accept(request, adapt, who);
    };
    out->removed = [runs](bytes_view, const adapter*, const subscriber_info& who) {
        runs->remove(who);
        return bytes();
    };
    return out;
}

action_runs::held_run action_runs::find(const run_id& id) const {
    auto found = std::ranges::find_if(all_, [&](const held_run& one) { return one->id == id; });
    return found == all_.end() ? nullptr : *found;
}

std::size_t action_runs::running() const noexcept {
    return static_cast<std::size_t>(
        std::ranges::count_if(all_, [](const held_run& one) { return one->is == provided_run::state::running; }));
}

result<bytes> action_runs::accept(bytes_view request, const adapter* adapt, const subscriber_info& who) {
    bytes ours;
    if (adapt) {
        ours = (*adapt)(request);
        request = ours;
    }
    if (request.size() < action_layout::goal)
        return failure(errc::malformed, fmt::format("a goal of '{}' came without its run", name_));
    run_id id;
    std::memcpy(id.data(), request.data() + action_layout::run, id.size());
    const auto life = detail::load_little<std::uint64_t>(request.data() + action_layout::life);
    const bool known = request[action_layout::known] != std::byte{0};
    const duration time(detail::load_little<std::int64_t>(request.data() + action_layout::time));
    auto& on = runtime_.on();
    action_accepted answer;
    if (auto run = find(id)) { // its requester comes back, over another session
        if (run->who != who.who) return failure(errc::access_denied, "the run is another identity's");
        run->subscriber = who.number;
        on.later([self = weak_from_this(), id] {
            if (auto here = self.lock()) here->tell_again(id);
        });
        return encode(answer);
    }
    if (life != 0 && life != runtime_.self().incarnation)
        return failure(errc::peer_lost,
                       fmt::format("the run of '{}' was given to another provider, or to this one before it was "
                                   "restarted: what became of it is unknown",
                                   name_),
                       execution::unknown);
    if (known || std::ranges::find(gone_, id) != gone_.end())
        return failure(errc::peer_lost,
                       fmt::format("the run of '{}' is over: its requester was out of reach for longer than the "
                                   "linger, or had cancelled it",
                                   name_),
                       execution::unknown);
    std::size_t before = 0;
    const auto goal = request.subspan(action_layout::goal);
    if (auto refused = make_room(goal.size(), before)) return std::move(*refused);
    answer.before = static_cast<std::uint32_t>(before);
    auto run = std::make_shared<provided_run>(weak_from_this(), on);
    run->id = id;
    run->subscriber = who.number;
    run->number = ++accepted_;
    run->requester = who.peer;
    run->who = who.who;
    run->goal.assign(goal.begin(), goal.end());
    all_.push_back(run);
    tap(*run, tapped_run::goal, run->goal);
    if (time > duration{}) run->deadline.arm(saturating_add(on.now(), time));
    // Behind the answer, which precedes the first report.
    on.later([self = weak_from_this()] {
        if (auto here = self.lock()) here->begin_next();
    });
    return encode(answer);
}

// For one more run with a goal of so many bytes; gives how many are executed before it.
std::optional<failure> action_runs::make_room(std::size_t goal, std::size_t& before) {
    std::vector<held_run> active;
    std::size_t goal_bytes = goal;
    for (const auto& one : all_) {
        if (one->is != provided_run::state::ended) active.push_back(one);
        if (one->is == provided_run::state::waiting) goal_bytes += one->goal.size();
    }
    if (active.size() < options_.concurrent) return std::nullopt;
    const auto waiting = active.size() - options_.concurrent; // those that begin in this turn do not
    switch (options_.busy) {
        case when_busy::refuse:
            return failure(errc::overloaded, fmt::format("'{}' executes {} goals already (action_options::concurrent)",
                                                         name_, active.size()));
        case when_busy::queue:
            if (waiting >= options_.waiting)
                return failure(errc::overloaded,
                               fmt::format("'{}' has {} goals waiting (action_options::waiting)", name_, waiting));
            if (goal_bytes > options_.waiting_bytes)
                return failure(errc::overloaded,
                               fmt::format("'{}' would have goals of {} bytes waiting (action_options::waiting_bytes)",
                                           name_, goal_bytes));
            before = waiting + 1;
            return std::nullopt;
        case when_busy::replace: break;
    }
    const failure replaced(errc::cancelled, fmt::format("the run of '{}' was replaced by a newer goal", name_),
                           execution::unknown);
    bool one_ends = false;
    for (const auto& one : active) {
        if (one->is == provided_run::state::waiting) {
            one->cause = failure(replaced.code(), std::string(replaced.message()));
            end(one, one->cause, {});
        } else if (!one_ends) {
            one_ends = true;
            if (!one->cause) cancel(*one, replaced);
        }
    }
    before = 1;
    return std::nullopt;
}

void action_runs::begin_next() {
    auto free = options_.concurrent - std::min(options_.concurrent, running());
    std::vector<held_run> ready;
    for (const auto& one : all_)
        if (one->is == provided_run::state::waiting && ready.size() < free) ready.push_back(one);
    for (const auto& one : ready) // one that ends at once has begun others
        if (one->is == provided_run::state::waiting && running() < options_.concurrent) launch(one);
}

void action_runs::launch(const held_run& run) {
    run->is = provided_run::state::running;
    auto* coroutine = runtime_.scope().spawn("run of " + name_, execute(shared_from_this(), run));
    if (run->is == provided_run::state::running) run->coroutine = coroutine;
    if (!coroutine && run->is == provided_run::state::running)
        end(run, failure(errc::cancelled, "the component stops"), {});
}

task<> action_runs::execute(std::shared_ptr<action_runs> self, held_run run) {
    struct leaving {
        provided_run& run;
        ~leaving() { run.coroutine = nullptr; }
    };
    leaving guard{*run};
    std::optional<failure> problem;
    bytes result;
    try {
        auto body = self->execute_(run);
        result = co_await std::move(body);
    } catch (...) {
        problem = detail::failure_of(std::current_exception());
    }
    if (problem && run->cause) problem = run->cause;
    if (problem && problem->code() == errc::handler_failed)
        self->runtime_.tell(peer_trouble::handler,
                            fmt::format("a run of '{}' failed: {}", self->name_, problem->message()), {});
    self->end(run, std::move(problem), std::move(result));
}

void action_runs::end(const held_run& run, std::optional<failure> why, bytes result) {
    run->is = provided_run::state::ended;
    run->coroutine = nullptr;
    run->deadline.disarm();
    run->latest = bytes();
    run->goal = bytes();
    if (why) result = encoded(*why);
    tap(*run, why ? tapped_run::failure : tapped_run::result, result);
    run->outcome = update_of(why ? a_failure : a_result, result);
    if (run->subscriber == 0) forget(*run);
    else tell(*run, run->outcome);
    begin_next();
}

void action_runs::cancel(provided_run& run, failure why) {
    run.cause = std::move(why);
    if (run.coroutine) run.coroutine->cancel();
}

void action_runs::on_deadline(provided_run& run) {
    failure late(errc::timed_out, fmt::format("the run of '{}' did not end within its deadline", name_),
                 run.is == provided_run::state::waiting ? execution::not_executed : execution::unknown);
    if (run.is == provided_run::state::running) return cancel(run, std::move(late));
    if (auto held = find(run.id); held && held->is == provided_run::state::waiting) end(held, std::move(late), {});
}

// Its requester has left, or did not come back within the linger.
void action_runs::remove(const subscriber_info& who) {
    auto found = std::ranges::find_if(all_, [&](const held_run& one) { return one->subscriber == who.number; });
    if (found == all_.end()) return; // it was refused, or came back as another subscriber
    auto run = *found;
    run->subscriber = 0;
    if (run->is == provided_run::state::running) {
        if (!run->cause)
            cancel(*run, failure(errc::cancelled, "its requester cancelled it, or was out of reach for too long"));
        return; // forgotten when the handler has ended
    }
    const bool ended = run->is == provided_run::state::ended;
    forget(*run);
    if (!ended) begin_next();
}

void action_runs::forget(const provided_run& run) {
    gone_.push_back(run.id);
    if (gone_.size() > remembered) gone_.pop_front();
    auto found = std::ranges::find_if(all_, [&](const held_run& one) { return one.get() == &run; });
    if (found == all_.end()) return;
    auto dropped = std::move(*found); // may be the last to hold it
    all_.erase(found);
    dropped->deadline.disarm();
}

void action_runs::tell(const provided_run& run, const bytes& update) {
    auto out = out_.lock();
    if (!out || run.subscriber == 0) return;
    bytes_view packet = update;
    bytes instead;
    // A report beyond what its requester accepts is dropped and counted. For the outcome it would wait for ever.
    if (const auto most = out->longest_for(run.subscriber);
        run.is == provided_run::state::ended && packet.size() > most) {
        const failure why(errc::too_large,
                          fmt::format("the result of '{}' has {} bytes, its requester accepts {} (max_message_bytes)",
                                      name_, packet.size(), most),
                          execution::unknown);
        runtime_.tell(peer_trouble::excess, why.message(), run.requester);
        packet = instead = update_of(a_failure, encoded(why));
    }
    auto made = out->encoded(current_trace(), packet);
    out->publish_to(std::move(made),
                    [number = run.subscriber](const subscriber_info& who) { return who.number == number; });
}

void action_runs::tap(const provided_run& run, std::uint8_t part, bytes_view packet) const {
    const auto& taps = runtime_.on().common<run_taps>();
    if (!taps.watches(runtime_)) return;
    tapped_run what;
    what.action = name_;
    what.run = run.number;
    what.requester = run.requester;
    what.part = part;
    what.packet.assign(packet.begin(), packet.end());
    taps.tell(runtime_, std::move(what));
}

void action_runs::tell_again(const run_id& id) {
    auto run = find(id);
    if (!run) return;
    if (run->is == provided_run::state::ended) tell(*run, run->outcome);
    else if (!run->latest.empty()) tell(*run, run->latest);
}

task<> action_runs::report(std::shared_ptr<provided_run> run, bytes feedback) {
    auto owner = run->owner.lock();
    if (!owner || run->is != provided_run::state::running)
        throw error(errc::invalid_argument, "progress was reported for a run that is over");
    if (!run->cause) {
        run->latest = update_of(a_report, feedback);
        owner->tap(*run, tapped_run::feedback, feedback);
        owner->tell(*run, run->latest);
    }
    auto& on = owner->runtime_.on();
    owner.reset();
    co_await sleep_for(on, duration());
}

} // namespace ise
