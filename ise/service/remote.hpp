#pragma once
#include <ise/call/pending_call.hpp>
#include <ise/core/held.hpp>
#include <ise/core/task.hpp>
#include <ise/packet/codec.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/session/contract.hpp>
#include <ise/subscription/subscriber.hpp>

#include <exception>
#include <memory>
#include <optional>
#include <source_location>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

namespace ise {

class peer_channel;

namespace detail {

/// Whether this is the thread of its component: on another one nothing of it may be touched.
bool is_here(const peer_channel& to);
/// The failure where it is not.
failure misplaced(const peer_channel& to, service_key service);
/// Everything of a call that needs no types, on the component's thread: opens the record, applies the deadline
/// and trace of the awaiting coroutine's call context, and sends. `where`: the place of the `co_await`, for messages.
void start_call(peer_channel& to, service_key service, duration deadline, const asio::any_io_executor& waiting,
                call_waiter& waiter, outgoing_packet request,
                const std::source_location& where = std::source_location());
/// Keeps `to` for a call.
held<call_owner> keep(peer_channel& to);
/// The same as what a subscriber needs of it.
std::shared_ptr<subscription_owner> subscriptions_of(std::shared_ptr<peer_channel> to);

/// Decodes the outcome where it is kept.
template <class Response>
void take_outcome(const call_outcome& outcome, std::optional<result<Response>>& into) {
    if (outcome.why) return void(into.emplace(*outcome.why));
    try {
        outcome.response->take_into(*into.emplace(Response{}));
    } catch (const error& unfit) { // the provider answered, and so it ran
        into.emplace(failure(unfit.code(), unfit.what(), execution::unknown));
    } catch (const std::exception& unfit) { // of a packet with functions of its own
        into.emplace(failure(errc::malformed, unfit.what(), execution::unknown));
    }
}

/// The arguments of a call behind its service: the fields of the request, and last perhaps the deadline.
template <class Request, class... Arguments>
struct call_arguments {
    using all = std::tuple<Arguments&&...>;
    static constexpr std::size_t count = sizeof...(Arguments);
    static consteval bool ends_in_duration() {
        if constexpr (count == 0) {
            return false;
        } else {
            return std::is_convertible_v<std::tuple_element_t<count - 1, all>, duration>;
        }
    }
    static constexpr bool has_deadline = ends_in_duration();
    template <std::size_t... Place>
    static consteval bool are_fields(std::index_sequence<Place...>) {
        return requires { Request{std::declval<std::tuple_element_t<Place, all>>()...}; };
    }
    static constexpr std::size_t fields = count - (has_deadline ? 1 : 0);

    static_assert(are_fields(std::make_index_sequence<fields>()),
                  "ise: behind the service, a call takes its request packet or the fields of it in their order, and "
                  "last the deadline");
    static_assert(!has_deadline || !are_fields(std::make_index_sequence<count>()),
                  "ise: the last argument of this call could be a field of the request as well as the deadline: give "
                  "the request as a "
                  "named variable");

    template <std::size_t... Place>
    static Request request(all& given, std::index_sequence<Place...>) {
        return Request{std::get<Place>(std::move(given))...};
    }
    static Request request(all& given) { return request(given, std::make_index_sequence<fields>()); }
    static duration deadline([[maybe_unused]] const all& given) {
        if constexpr (has_deadline) {
            return std::get<count - 1>(given);
        } else {
            return duration();
        }
    }
};

template <class Request, class... Arguments>
inline constexpr bool is_request_itself = false;
template <class Request, class First, class... Rest>
inline constexpr bool is_request_itself<Request, First, Rest...> = std::is_same_v<std::remove_cvref_t<First>, Request>;

template <class...>
inline constexpr bool never = false;

template <class T>
inline constexpr bool is_result = false;
template <class T>
inline constexpr bool is_result<result<T>> = true;

} // namespace detail

/// A call, which begins when it is awaited. `Outcome` is what `co_await` returns: the response, or an ise::result of
/// it. Converts to `ise::task`.
template <class Contract, class Outcome>
class [[nodiscard]] call_operation final : public awaiter, private call_waiter {
    using request_type = typename Contract::request_type;
    using response_type = typename Contract::response_type;

public:
    call_operation(std::shared_ptr<peer_channel> to, service_key service, request_type request, duration deadline)
        : to_(std::move(to)), service_(service), request_(std::move(request)), deadline_(deadline) {}
    /// Only before it begins.
    call_operation(call_operation&& other)
        : call_operation(std::move(other.to_), other.service_, std::move(other.request_), other.deadline_) {}

    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) {
        auto& stack = coroutine.promise().stack();
        waiting_ = stack.suspend(*this);
        if (!detail::is_here(*to_)) [[unlikely]] {
            got_.emplace(detail::misplaced(*to_, service_));
            return waiting_.resume();
        }
        detail::start_call(*to_, service_, deadline_, stack.executor(), *this, outgoing_packet(request_), where_);
    }
    /// Where it is awaited (`task_promise_base::await_transform`).
    void awaited_at(const std::source_location& where) noexcept { where_ = where; }
    Outcome await_resume() {
        if constexpr (detail::is_result<Outcome>) return std::move(*got_);
        else return std::move(got_->value());
    }
    void cancel() override { give_up(); }

    operator task<Outcome>() && { return as_task(std::move(*this)); }

private:
    void end(loop& on, const call_outcome& outcome) override {
        detail::take_outcome(outcome, got_);
        on.later([waiting = std::move(waiting_)]() mutable { waiting.resume(); });
    }
    void drop() noexcept override { auto dropped = std::move(waiting_); }

    std::shared_ptr<peer_channel> to_;
    service_key service_;
    request_type request_;
    duration deadline_;
    suspended_stack waiting_;
    std::optional<result<response_type>> got_;
    std::source_location where_;
};

/// A handle to another component, for calls and subscriptions. A value, cheap to copy. It names a path (or an address),
/// and resolves it again when needed. Used on the loop of the component that made it.
class remote {
public:
    remote() = default;
    /// Made by `component::find`, `at` and `caller`.
    explicit remote(std::shared_ptr<peer_channel> to) : link_(std::move(to)) {}

    /// Whether it names a component; a default-constructed handle must not be used.
    explicit operator bool() const noexcept { return link_ != nullptr; }
    /// Its path, or its address.
    const std::string& name() const noexcept;
    /// The path of the component to which it is connected now; for a role, that of the member. Empty without a session.
    std::string holder() const;
    peer_channel& way() const noexcept { return *link_; } ///< for the layers below

    /// Calls and waits for the response: `co_await boat.call(helm, "hold", 2s)`. The arguments after the service are
    /// the fields of the request in their order; if the last one is a duration, it is the deadline (default: that of
    /// the context, else the component's). Throws ise::error: refused, no_such_service, type_mismatch, timed_out,
    /// peer_lost, cancelled, overloaded, handler_failed…; `executed()` says whether the request may have run.
    /// Cancellation: terminal; the provider's handler is cancelled too.
    template <class Contract, class... Arguments>
    requires(!detail::is_request_itself<typename Contract::request_type, Arguments...>)
        call_operation<Contract, typename Contract::response_type> call(const Contract& service,
                                                                        Arguments&&... arguments)
    const {
        using given = detail::call_arguments<typename Contract::request_type, Arguments...>;
        typename given::all all(std::forward<Arguments>(arguments)...);
        return call(service, given::request(all), given::deadline(all));
    }

    /// The same with a request object; errors and cancellation as above. With g++ 12 use a named variable: that
    /// compiler destroys a braced temporary inside a `co_await` expression twice (docs/coroutines.md).
    template <class Contract>
    call_operation<Contract, typename Contract::response_type> call(const Contract& service,
                                                                    typename Contract::request_type request,
                                                                    duration deadline = duration()) const {
        return call_operation<Contract, typename Contract::response_type>(link_, service.key(), std::move(request),
                                                                          deadline);
    }

    /// The same as `call`, with the outcome as a value: `co_await boat.try_call(helm, "hold", 2s)`. Cancellation:
    /// terminal; the provider's handler is cancelled too.
    template <class Contract, class... Arguments>
    requires(!detail::is_request_itself<typename Contract::request_type, Arguments...>)
        call_operation<Contract, result<typename Contract::response_type>> try_call(const Contract& service,
                                                                                    Arguments&&... arguments)
    const {
        using given = detail::call_arguments<typename Contract::request_type, Arguments...>;
        typename given::all all(std::forward<Arguments>(arguments)...);
        return try_call(service, given::request(all), given::deadline(all));
    }
    /// The same with a request object; see `call`.
    template <class Contract>
    call_operation<Contract, result<typename Contract::response_type>> try_call(const Contract& service,
                                                                                typename Contract::request_type request,
                                                                                duration deadline = duration()) const {
        return call_operation<Contract, result<typename Contract::response_type>>(link_, service.key(),
                                                                                  std::move(request), deadline);
    }

    /// The same with a completion token of signature `void(ise::result<Response>)`, such as a callback, which
    /// runs on the component's loop. Needs <ise/asio.hpp>.
    template <class Contract, class Token>
    auto try_call(const Contract& service, typename Contract::request_type request, duration deadline,
                  Token&& token) const {
        using edge = detail::asio_edge<std::remove_cvref_t<Token>>;
        static_assert(
            requires { sizeof(edge); }, "ise: to call with a completion token, include <ise/asio.hpp>");
        return edge::call(link_, service, std::move(request), deadline, std::forward<Token>(token));
    }

    /// Subscribes, and completes when the provider has committed: every packet that it publishes from then on arrives
    /// or is counted. Throws ise::error: refused, no_such_service, type_mismatch, timed_out, cancelled. Cancellation:
    /// terminal, unsubscribes.
    template <class Contract>
    task<subscriber<Contract>> subscribe(const Contract& service,
                                         subscribe_options options = subscribe_options()) const {
        return begin<Contract>(link_, std::string(service.name()), options, bytes());
    }
    /// The same with the user's own subscribe packet, which is encoded at once: it need not live on. Cancellation:
    /// terminal, unsubscribes.
    template <class Contract>
    task<subscriber<Contract>> subscribe(const Contract& service, const typename Contract::subscribe_request& request,
                                         subscribe_options options) const {
        return begin<Contract>(link_, std::string(service.name()), options, encode(request));
    }

    /// Starts a run of an action, and completes when the provider has accepted the goal: `auto run = co_await
    /// boat.start(sail_to, goal)`. Destroying the run cancels it. Throws ise::error: those of `subscribe`, and
    /// overloaded if the provider is at its limit of goals; `executed()` says whether it may have begun.
    /// Cancellation: terminal, cancels the run. The goal is encoded before this returns.
    template <class Goal, class Feedback, class Result>
    task<action_run<action<Goal, Feedback, Result>>> start(const action<Goal, Feedback, Result>& service,
                                                           const Goal& goal,
                                                           run_options options = run_options()) const {
        return begin_run<action<Goal, Feedback, Result>>(link_, std::string(service.name()), options, encode(goal));
    }

    /// A compile error for services of the other kind; so are the next two.
    template <class... Packets, class... Arguments>
    void call(const subscription<Packets...>&, Arguments&&...) const {
        static_assert(detail::never<Packets...>,
                      "ise: this service is a subscription, which is not called: co_await remote.subscribe(service)");
    }
    /// See above.
    template <class... Packets, class... Arguments>
    void try_call(const subscription<Packets...>& service, Arguments&&...) const {
        call(service);
    }
    /// See above.
    template <class... Packets, class... Arguments>
    void subscribe(const request_response<Packets...>&, Arguments&&...) const {
        static_assert(
            detail::never<Packets...>,
            "ise: this service is a request-response, which is not subscribed to: co_await remote.call(service, …)");
    }

    /// Waits until there is a session; for programs that want to know before they call. errc::timed_out after
    /// `deadline`, with the last obstacle. Cancellation: terminal, returns errc::cancelled.
    task<result<void>> connect(duration deadline) const;

private:
    template <class Contract>
    static task<subscriber<Contract>> begin(std::shared_ptr<peer_channel> to, std::string service,
                                            subscribe_options options, bytes request) {
        if (!detail::is_here(*to)) throw error(detail::misplaced(*to, {service, nullptr}));
        if (request.empty()) request = encode(typename Contract::subscribe_request{});
        auto core = std::make_shared<typename subscriber<Contract>::core>(detail::subscriptions_of(std::move(to)),
                                                                          std::move(service), Contract::types(),
                                                                          options, std::move(request));
        subscriber<Contract> made(core); // leaves again if the wait is cancelled
        auto begun = co_await core->begin();
        begun.value();
        co_return made;
    }

    template <class Action>
    static task<action_run<Action>> begin_run(std::shared_ptr<peer_channel> to, std::string service,
                                              run_options options, bytes goal) {
        if (!detail::is_here(*to)) throw error(detail::misplaced(*to, {service, nullptr}));
        auto core = std::make_shared<run_core>(detail::subscriptions_of(std::move(to)), std::move(service),
                                               Action::types(), options, goal);
        action_run<Action> made(core); // cancels it again if the wait is cancelled
        auto begun = co_await run_core::start(core);
        begun.value();
        co_return made;
    }

    std::shared_ptr<peer_channel> link_;
};

} // namespace ise
