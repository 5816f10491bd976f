#pragma once
#include <ise/call/provide.hpp>
#include <ise/component/runnable.hpp>
#include <ise/core/blocking_outcome.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_runs.hpp>
#include <ise/service/remote.hpp>
#include <ise/service/role_options.hpp>
#include <ise/subscription/publication.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace ise {

class service_host;
class component;

namespace detail {

/// Parts of the templates of `component`, kept apart so that a derived class does not inherit their names.
struct component_parts {
    static service_runtime& runtime(component& of);
    static void add(component& to, std::shared_ptr<call_service> service);
    static void add(component& to, std::shared_ptr<publication_core> service);
    static void withdraw(component& from, const std::string& name);
    static void declare_required(component& by, const std::string& name, const packet_types& types);
    static void check_may_block(component& on);
    static void check_period(duration period);
    /// Starts a coroutine of the flow from any thread; it is destroyed unstarted if the component stops.
    static void post_spawn(component& on, std::string name, task<> body);
    /// Makes what a coroutine of a stopped component throws a clear error.
    [[noreturn]] static void throw_outcome(component& of, const std::exception_ptr& thrown);
    /// Whether a subscription that was not made is worth another try.
    static bool keeps_trying(const failure& why) noexcept;
    static task<> run_elsewhere(component& self, unique_function<void()> job);

    template <class Contract>
    static task<> tick(component& self, publication<Contract> out, duration period,
                       std::function<typename Contract::packet_type()> make);
    template <class Contract>
    static task<> each(remote provider, Contract service,
                       std::function<void(const typename Contract::packet_type&)> on_packet,
                       subscribe_options options) {
        subscriber<Contract> packets;
        for (;;) {
            std::optional<failure> why;
            try {
                packets = co_await provider.subscribe(service, options);
            } catch (const error& refused) {
                why = refused.why();
            }
            if (!why) break;
            if (!keeps_trying(*why)) throw error(std::move(*why));
        }
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
            on_packet(*packet);
        }
    }
    template <class T>
    static task<> fulfil(task<T> body, blocking_outcome<T> made) {
        std::exception_ptr thrown;
        try {
            if constexpr (std::is_void_v<T>) {
                co_await std::move(body);
                made.fulfil();
            } else {
                auto value = co_await std::move(body);
                made.fulfil(std::move(value));
            }
        } catch (...) {
            thrown = std::current_exception();
        }
        if (thrown) made.fail(std::move(thrown)); // behind the handler, which has a reference of its own
    }
    template <class Work>
    static task<std::invoke_result_t<Work&>> offload(component& self, Work work) {
        using value = std::invoke_result_t<Work&>;
        if constexpr (std::is_void_v<value>) {
            unique_function<void()> job = [&work] { work(); };
            co_await run_elsewhere(self, std::move(job));
        } else {
            std::optional<value> made;
            unique_function<void()> job = [&] { made.emplace(work()); };
            co_await run_elsewhere(self, std::move(job));
            co_return std::move(*made);
        }
    }
};

} // namespace detail

/// An active object: its own flow of execution (`run()`), the services that it provides, and the services of others
/// that it uses. Derive from it, or pass a coroutine to `node::start`. Its constructor only stores what it is given:
/// services are provided, used and logged about from `run()` on, before which all members but `state` and
/// `announce_when_ready` throw ise::error with errc::invalid_argument.
///
/// All code of a component runs on its loop; handlers and `run()` interleave only at `co_await`. When the component is
/// stopped, its coroutines are cancelled at their next suspension, its sessions are closed, and its name is withdrawn.
/// A cancelled `call`, `subscribe` or `start` throws ise::error with errc::cancelled; all other waits throw
/// std::system_error with `asio::error::operation_aborted`. `ise::is_cancellation` (<ise/core/task_scope.hpp>)
/// recognizes both. An exception that escapes from `run()` or a spawned coroutine is logged with the component's path
/// and follows the failure policy with which the component was started.
///
/// Names that a derived class inherits, besides two private ones that end with an underscore. A member or a local
/// variable with the same name hides one:
/// - itself: `path`, `env`, `on`, `get_executor`, `log`, `state`, `services`, `stop`;
/// - provided services: `provide`, `provide_exclusive`, `publish`, `publish_every`, `withdraw`, `require`,
///   `serve_role`, `leave_role`, `name_confirmed`, `announce_when_ready`, `ready`;
/// - other components: `find`, `at`, `caller`, `listen`;
/// - its flow: `spawn`, `sleep`, `sleep_till`, `now`, `wall`, `offload`, and `wait` from other threads;
/// - to override: `run`, `on_name_lost`.
class component : public runnable {
public:
    component();
    ~component() override;

    /// Its name in the system: "atirma/boat". Empty for an anonymous component.
    const std::string& path() const;
    /// The environment of its node.
    environment& env() const;
    /// Its event loop.
    loop& on() const;
    /// The executor of its loop, for Asio's own operations (<ise/asio.hpp>). It lives until the component has stopped.
    const asio::any_io_executor& get_executor() const;
    /// A logger that adds its path, and writes to the sink of its node.
    const logger& log() const;
    /// Its present state. Call it on its loop; other threads use `node::components()`.
    component_state state() const noexcept;
    /// The service layer of this component, for counts and for lower layers: <ise/service/service_host.hpp>.
    service_host& services() const;

    // --- provided services --------------------------------------------------------------------------------------

    /// Answers the requests of a service by `handler`, which is `ise::task<Response>(Request)` or `Response(Request)`,
    /// with an optional second parameter `const ise::call_context&`, until the component stops or calls `withdraw`.
    /// Throws errc::invalid_argument if the component already has a service of that name.
    template <class Contract, class Handler>
    void provide(const Contract& service, Handler handler, serve_options options = serve_options()) {
        using parts = detail::component_parts;
        parts::add(*this, make_call_service(parts::runtime(*this), service, std::move(handler), options));
    }
    /// The same, with at most one handler running at a time.
    template <class Contract, class Handler>
    void provide_exclusive(const Contract& service, Handler handler) {
        serve_options one;
        one.concurrent = 1;
        provide(service, std::move(handler), one);
    }
    /// Executes the goals of an action by `handler`, a coroutine `ise::task<Result>(Goal, ise::progress<Feedback>)`: it
    /// reports with `co_await progress(feedback)` and ends with `co_return result`. It is cancelled when its requester
    /// cancels the run or does not reconnect within the linger (30 s), at the run's deadline, and when a newer goal
    /// replaces it. Its exceptions end the run: an ise::error with errc::refused or errc::access_denied reaches the
    /// requester unchanged, all others as errc::handler_failed.
    template <class Goal, class Feedback, class Result, class Handler>
    void provide(const action<Goal, Feedback, Result>& service, Handler handler,
                 action_options options = action_options()) {
        using parts = detail::component_parts;
        parts::add(*this, make_action(parts::runtime(*this), service, std::move(handler), options));
    }
    /// Provides a subscription service: call the result to publish.
    template <class Contract>
    publication<Contract> publish(const Contract& service,
                                  publication_callbacks<Contract> callbacks = publication_callbacks<Contract>()) {
        auto core = make_publication(detail::component_parts::runtime(*this), service, std::move(callbacks));
        detail::component_parts::add(*this, core);
        return publication<Contract>(core);
    }
    /// A compile error: a subscription is published.
    template <class... Packets, class Handler>
    void provide(const subscription<Packets...>&, Handler&&, serve_options = serve_options()) {
        static_assert(detail::never<Packets...>,
                      "ise: this service is a subscription, which is published: auto out = publish(service)");
    }
    /// A compile error: a request-response is provided.
    template <class... Packets>
    void publish(const request_response<Packets...>&) {
        static_assert(detail::never<Packets...>,
                      "ise: this service is a request-response, which is provided: provide(service, handler)");
    }

    /// Publishes the result of `make()`, now and every `period` until the component stops. Missed ticks are skipped,
    /// not replayed. Throws errc::invalid_argument for a period that is not positive.
    template <class Contract, class Make>
    void publish_every(const Contract& service, duration period, Make make) {
        using packet_type = typename Contract::packet_type;
        if constexpr (std::is_invocable_r_v<packet_type, Make&>) {
            using parts = detail::component_parts;
            parts::check_period(period);
            spawn(std::string(service.name()),
                  parts::tick(*this, publish(service), period, std::function<packet_type()>(std::move(make))));
        } else {
            static_assert(detail::never<Make>,
                          "ise: publish_every takes a function without arguments that returns a packet of the service");
        }
    }
    /// Ends a provided service.
    template <class Contract>
    void withdraw(const Contract& service) {
        detail::component_parts::withdraw(*this, std::string(service.name()));
    }
    /// Serves a role beside its own name, or changes its priority there (the highest is preferred). `leave_role` ends
    /// it, and handles fail over to the next member. The name server is notified at once.
    void serve_role(const std::string& role, std::int32_t priority = 0);
    void leave_role(const std::string& role); ///< see `serve_role`
    /// Whether its name is granted and its lease valid, by the knowledge of this node. While the name server is
    /// unreachable, or has no room, the name is unconfirmed: sessions continue, but another component may be granted
    /// it.
    bool name_confirmed() const;
    /// Declares a service of another component that this one needs: if it has no provider, `ise doctor` reports that.
    /// Services that are called or subscribed to are shown without a declaration.
    template <class Contract>
    void require(const Contract& service) {
        detail::component_parts::declare_required(*this, std::string(service.name()), Contract::types());
    }

    // --- other components ---------------------------------------------------------------------------------------

    /// Returns the component at `path` as soon as it is registered. Throws errc::no_such_name or errc::name_server_lost
    /// after `wait` (default: no limit). A wait of more than 3 s is logged, and shown by `ise list`, `describe` and
    /// `doctor`. Cancellation: terminal, throws `operation_aborted`. A role is found like a name: the handle uses the
    /// live member with the highest priority, fails over to the next one, and returns to a better one according to
    /// `how`. Subscriptions continue at the next member after a gap of unknown length; a call moves too, unless a byte
    /// of it was written already (peer_lost, unknown).
    task<remote> find(std::string path, duration wait = duration::max());
    task<remote> find(std::string path, role_options how, duration wait = duration::max()); ///< the same
    /// A handle to the component at `path`, whether it is registered now or not: calls wait for it within their
    /// deadline.
    remote at(const std::string& path, role_options how = role_options());
    /// A handle to the component `path` that listens at `where`; with an empty path any component that listens there.
    remote at(const endpoint& where, const std::string& path = std::string());
    /// The same for one of several endpoints, such as name servers: the next is tried when one is lost.
    remote at(const std::vector<endpoint>& any_of, const std::string& path);
    /// A handle to the caller of the call being answered, for calling back over the same session.
    remote caller(const call_context& context);

    /// Subscribes with a callback: calls `on_packet(const Packet&)` for every packet, in order, on the component's
    /// loop, until the subscription ends (service withdrawn, lossless overflow, `disconnect`). The end is logged; the
    /// callback is not called. Waits for a missing provider without a limit. A refusal, or an exception of the
    /// callback, follows the failure policy.
    template <class Contract, class Callback>
    void listen(remote provider, const Contract& service, Callback on_packet,
                subscribe_options options = subscribe_options()) {
        using callback = std::function<void(const typename Contract::packet_type&)>;
        spawn(std::string(service.name()),
              detail::component_parts::each(std::move(provider), service, callback(std::move(on_packet)), options));
    }

    // --- its own flow -------------------------------------------------------------------------------------------

    /// Starts a coroutine that the component owns: stopping the component cancels it and waits for it.
    void spawn(std::string name, task<> body);
    /// Suspends for `length`, on the clock of the environment. Cancellation: terminal, throws `operation_aborted`.
    task<> sleep(duration length) { return sleep_for(on(), length); }
    /// Suspends until `at`; if that has passed, other coroutines run once. Cancellation: as `sleep`.
    task<> sleep_till(time_point at) { return sleep_until(on(), at); }
    /// The monotonic clock; constant within one loop iteration.
    time_point now() const { return on().now(); }
    /// Civil time, UTC.
    wall_time wall() const { return env().wall(); }
    /// Runs `work` on another thread and returns its result: for long computations. Rethrows its exception. `work` may
    /// refer to variables of the coroutine: cancellation does not interrupt it, and takes effect at the next
    /// suspension.
    template <class Work>
    task<std::invoke_result_t<Work&>> offload(Work work) {
        return detail::component_parts::offload(*this, std::move(work));
    }

    /// Call it in the constructor: the component is then registered when it awaits `ready()`, instead of when `run()`
    /// first suspends or returns.
    void announce_when_ready() noexcept { announce_when_ready_ = true; }
    /// Completes when the component can be found by name (at once if it has no name, or there is no name server now).
    /// Cancellation: terminal, throws `operation_aborted`; the component is registered all the same.
    task<> ready();
    /// Asks the component to stop, and returns at once.
    void stop();

    // --- from other threads -------------------------------------------------------------------------------------

    /// Runs a coroutine on the component's loop and blocks the calling thread until it is done; rethrows its exception.
    /// Throws errc::cancelled if the component stops meanwhile or has stopped; errc::would_block_self on the
    /// component's own loop, and in the virtual world, where nothing may block.
    template <class T>
    T wait(task<T> body) {
        using parts = detail::component_parts;
        parts::check_may_block(*this);
        blocking_outcome<T> made;
        auto outcome = made.other_end();
        parts::post_spawn(*this, "wait", parts::fulfil<T>(std::move(body), std::move(made)));
        try {
            return outcome.get();
        } catch (...) {
            parts::throw_outcome(*this, std::current_exception());
        }
    }

protected:
    /// The component's own flow. Returning ends the flow, not the component: its services continue until it is stopped.
    task<> run() override = 0;

    /// Called once, on the loop, when another component holds the name under a higher epoch (errc::superseded). The
    /// sessions end with that error, and no new ones are made. By default the component stops as failed; if this is
    /// overridden, it continues without a name and without clients until `stop()`.
    void on_name_lost(const failure& why) override;
};

template <class Contract>
task<> detail::component_parts::tick(component& self, publication<Contract> out, duration period,
                                     std::function<typename Contract::packet_type()> make) {
    for (auto at = self.now();;) {
        co_await self.sleep_till(at);
        out(make());
        at = saturating_add(at, period);
        if (at < self.now()) at += ((self.now() - at) / period + 1) * period;
    }
}

} // namespace ise
