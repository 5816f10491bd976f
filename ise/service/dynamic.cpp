#include <ise/service/dynamic.hpp>

#include <ise/service/fitted_bytes.hpp>
#include <ise/service/peer_channel.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

std::optional<failure> check_kind(const remote& provider, const dynamic_contract& service, service_kind wanted) {
    if (service.kind() == wanted) return std::nullopt;
    return failure(errc::invalid_argument,
                   fmt::format("'{}' at {} is a {} service: {}", service.name(), provider.name(),
                               name_of(service.kind()),
                               wanted == service_kind::subscription ? "call it" : "subscribe to it"));
}

result<dynamic_packet> response_of(const call_outcome& outcome, const schema& type) {
    if (outcome.why) return *outcome.why;
    try {
        const auto raw = outcome.response->bytes();
        return dynamic_packet(type, bytes(raw.begin(), raw.end()));
    } catch (const error& unfit) {
        // The provider answered, and so it ran.
        return failure(unfit.code(), unfit.what(), execution::unknown);
    }
}

/// A call whose packets are bytes. Whoever waits keeps the types, the service's name and the request.
class submitted_call final : public awaiter, private call_waiter {
public:
    submitted_call(std::shared_ptr<peer_channel> to, std::string_view service, const packet_types& types,
                   bytes_view request, duration deadline)
        : to_(std::move(to)), service_{service, &types}, request_(request), deadline_(deadline) {}

    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) {
        auto& stack = coroutine.promise().stack();
        waiting_ = stack.suspend(*this);
        detail::start_call(*to_, service_, deadline_, stack.executor(), *this, outgoing_packet::of_bytes(request_));
    }
    result<dynamic_packet> await_resume() { return std::move(*got_); }
    void cancel() override { give_up(); }

private:
    void end(loop& on, const call_outcome& outcome) override {
        got_.emplace(response_of(outcome, service_.types->schemas[role::response]));
        on.later([waiting = std::move(waiting_)]() mutable { waiting.resume(); });
    }
    void drop() noexcept override { auto dropped = std::move(waiting_); }

    std::shared_ptr<peer_channel> to_;
    service_key service_;
    bytes_view request_;
    duration deadline_;
    suspended_stack waiting_;
    std::optional<result<dynamic_packet>> got_;
};

} // namespace

result<dynamic_contract> dynamic_contract::make(std::string name, service_kind kind, std::vector<schema> packets) {
    std::size_t wanted = kind == service_kind::request_response ? 2 : 5;
    if (packets.size() != wanted)
        return failure(errc::invalid_argument,
                       fmt::format("the {} service '{}' was described with {} packets, it has {}", name_of(kind), name,
                                   packets.size(), wanted));
    return dynamic_contract(std::move(name), std::make_shared<const packet_types>(kind, std::move(packets)));
}

result<dynamic_contract> dynamic_contract::parse(std::string name, service_kind kind,
                                                 const std::vector<std::string>& schema_texts) {
    std::vector<schema> packets;
    for (const auto& text : schema_texts) {
        auto parsed = schema::parse(text);
        if (!parsed)
            return failure(parsed.error().code(),
                           fmt::format("the {} of '{}' is not described readably: {}", role::name(kind, packets.size()),
                                       name, parsed.error().message()));
        packets.push_back(std::move(*parsed));
    }
    return make(std::move(name), kind, std::move(packets));
}

// A packet without fields in the layout of one with fields: each takes its default.
dynamic_packet default_packet(const schema& of) { return dynamic_packet(of, adapt(schema(), of, {})); }

task<result<dynamic_packet>> call_dynamic(remote provider, dynamic_contract service, dynamic_packet request,
                                          duration deadline) {
    auto& way = provider.way();
    if (!detail::is_here(way)) co_return way.misplaced({service.name(), nullptr});
    if (auto wrong = check_kind(provider, service, service_kind::request_response)) co_return std::move(*wrong);
    auto kept = way.runtime().schemas().keep(service.types());
    if (!kept) co_return kept.error();
    std::optional<fitted_bytes> body;
    try {
        body.emplace(request, service.packet(role::request));
    } catch (const error& unfit) {
        co_return unfit.why();
    }
    auto answer = co_await submitted_call(way.shared_from_this(), service.name(), **kept, body->view(), deadline);
    co_return answer;
}

class dynamic_stream::core final : public subscriber_core {
public:
    core(std::shared_ptr<peer_channel> to, std::string service, std::shared_ptr<const packet_types> types,
         subscribe_options options, bytes request)
        : subscriber_core(std::move(to), std::move(service), *types, options, std::move(request)),
          response(default_packet(types->schemas[role::subscribe_response])), types_(std::move(types)) {}

    static task<received<dynamic_packet>> next(std::shared_ptr<core> self) {
        for (;;) {
            auto packet = self->take();
            if (packet || self->ended()) co_return packet;
            co_await self->wait_for_packet();
        }
    }

    static task<result<dynamic_packet>> leave_with(std::shared_ptr<core> self, dynamic_packet request,
                                                   duration deadline) {
        bytes raw;
        try {
            raw = fitted_bytes(request, self->types_->schemas[role::unsubscribe_request]).copy();
        } catch (const error& unfit) {
            co_return unfit.why();
        }
        auto leaving = self->subscriber_core::leave_with(std::move(raw), deadline);
        auto answer = co_await std::move(leaving);
        if (!answer) co_return answer.error();
        const auto& type = self->types_->schemas[role::unsubscribe_response];
        if (answer->empty()) co_return default_packet(type);
        try {
            co_return read(type, *answer);
        } catch (const error& unfit) {
            co_return unfit.why();
        }
    }

    received<dynamic_packet> take() {
        while (!queue_.empty()) {
            auto waiting = queue_.front();
            try {
                auto packet =
                    counted<dynamic_packet>::make(read(types_->schemas[role::published], waiting.bytes_to_decode()));
                return received<dynamic_packet>(std::move(packet), take_packet());
            } catch (const error& unreadable) {
                drop_undecodable(unreadable);
            }
        }
        return {};
    }

    dynamic_packet response;

private:
    static dynamic_packet read(const schema& type, bytes_view raw) {
        return dynamic_packet(type, bytes(raw.begin(), raw.end()));
    }

    void take_response(bytes_view raw) override {
        if (!raw.empty()) response = read(types_->schemas[role::subscribe_response], raw);
    }

    std::shared_ptr<const packet_types> types_;
};

dynamic_stream::dynamic_stream(std::shared_ptr<core> made) noexcept : core_(std::move(made)) {}

dynamic_stream& dynamic_stream::operator=(dynamic_stream&& other) noexcept {
    if (core_ && core_ != other.core_) core_->unsubscribe();
    core_ = std::move(other.core_);
    return *this;
}

dynamic_stream::~dynamic_stream() {
    if (core_) core_->unsubscribe();
}

task<received<dynamic_packet>> dynamic_stream::next() { return core::next(core_); }
received<dynamic_packet> dynamic_stream::try_next() { return core_->take(); }
const dynamic_packet& dynamic_stream::response() const noexcept { return core_->response; }
const subscription_counts& dynamic_stream::counts() const noexcept { return core_->counts(); }
bool dynamic_stream::connected() const noexcept { return core_->connected(); }
bool dynamic_stream::ended() const noexcept { return core_->ended(); }
const failure& dynamic_stream::cause() const noexcept { return core_->cause(); }
void dynamic_stream::unsubscribe() { core_->unsubscribe(); }
task<result<dynamic_packet>> dynamic_stream::unsubscribe(dynamic_packet request, duration deadline) {
    return core::leave_with(core_, std::move(request), deadline);
}

dynamic_run::dynamic_run(std::shared_ptr<run_core> core, action_schemas types)
    : core_(std::move(core)), types_(std::move(types)) {}

dynamic_run& dynamic_run::operator=(dynamic_run&& other) noexcept {
    if (core_ && core_ != other.core_) core_->cancel();
    core_ = std::move(other.core_);
    types_ = std::move(other.types_);
    return *this;
}

dynamic_run::~dynamic_run() {
    if (core_) core_->cancel();
}

namespace {

task<std::optional<dynamic_packet>> next_report(std::shared_ptr<run_core> core, schema type) {
    auto raw = co_await run_core::next(std::move(core));
    std::optional<dynamic_packet> report;
    if (raw) report.emplace(std::move(type), std::move(*raw));
    co_return report;
}

task<result<dynamic_packet>> outcome_of(std::shared_ptr<run_core> core, schema type) {
    auto raw = co_await run_core::finish(std::move(core));
    if (!raw) co_return raw.error();
    try {
        co_return dynamic_packet(std::move(type), std::move(*raw));
    } catch (const error& unfit) { // it ran
        co_return failure(unfit.code(), unfit.what(), execution::unknown);
    }
}

} // namespace

task<std::optional<dynamic_packet>> dynamic_run::next() { return next_report(core_, types_.feedback); }
task<result<dynamic_packet>> dynamic_run::outcome() { return outcome_of(core_, types_.result); }
void dynamic_run::cancel() { core_->cancel(); }
std::uint32_t dynamic_run::queue_position() const { return core_->queue_position(); }

task<result<dynamic_run>> start_dynamic(remote provider, dynamic_contract service, dynamic_packet goal,
                                        run_options options) {
    auto& way = provider.way();
    if (!detail::is_here(way)) co_return way.misplaced({service.name(), nullptr});
    if (!is_action(*service.types()))
        co_return failure(errc::invalid_argument,
                          fmt::format("'{}' at {} is a {} service, not an action", service.name(), provider.name(),
                                      name_of(service.kind())));
    auto kept = way.runtime().schemas().keep(service.types());
    if (!kept) co_return kept.error();
    auto types = schemas_of_action(**kept);
    std::shared_ptr<run_core> core;
    try {
        auto body = fitted_bytes(goal, types.goal).copy();
        core = std::make_shared<run_core>(way.shared_from_this(), service.name(), **kept, options, body);
    } catch (const error& unfit) {
        co_return unfit.why();
    }
    dynamic_run made(core, std::move(types)); // cancels it again if the wait is cancelled
    auto begun = co_await run_core::start(core);
    if (!begun) co_return begun.error();
    co_return std::move(made);
}

task<result<dynamic_stream>> subscribe_dynamic(remote provider, dynamic_contract service, dynamic_packet request,
                                               subscribe_options options) {
    auto& way = provider.way();
    if (!detail::is_here(way)) co_return way.misplaced({service.name(), nullptr});
    if (auto wrong = check_kind(provider, service, service_kind::subscription)) co_return std::move(*wrong);
    auto kept = way.runtime().schemas().keep(service.types());
    if (!kept) co_return kept.error();
    std::shared_ptr<dynamic_stream::core> core;
    try {
        auto body = fitted_bytes(request, service.packet(role::subscribe_request)).copy();
        core = std::make_shared<dynamic_stream::core>(way.shared_from_this(), service.name(), std::move(*kept), options,
                                                      std::move(body));
    } catch (const error& unfit) {
        co_return unfit.why();
    }
    dynamic_stream made(core); // leaves again if the wait is cancelled
    auto begun = co_await core->begin();
    if (!begun) co_return begun.error();
    co_return std::move(made);
}

task<result<dynamic_stream>> subscribe_dynamic(remote provider, dynamic_contract service, subscribe_options options) {
    if (auto wrong = check_kind(provider, service, service_kind::subscription)) co_return std::move(*wrong);
    std::optional<dynamic_packet> request;
    try {
        request.emplace(default_packet(service.packet(role::subscribe_request)));
    } catch (const error& none) {
        co_return none.why();
    }
    auto made = co_await subscribe_dynamic(std::move(provider), std::move(service), std::move(*request), options);
    co_return std::move(made);
}

} // namespace ise
