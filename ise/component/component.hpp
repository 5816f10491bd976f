#pragma once
#include <ise/component/introspection.hpp>
#include <ise/component/runnable.hpp>
#include <ise/core/blocking_outcome.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task.hpp>
#include <ise/service/provide.hpp>
#include <ise/service/publication.hpp>
#include <ise/service/remote.hpp>
#include <ise/service/role_options.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace ise {

class service_host;

/// An active object: a flow of execution of its own (`run()`), the services it provides, and the services of others
/// that it uses. Derive from it, or give a coroutine to `node::start`.
///
/// Everything of a component runs on its loop; handlers and `run()` interleave at `co_await`. When it is stopped, its
/// coroutines are cancelled at their next suspension (`operation_aborted` is thrown there), its sessions say goodbye,
/// and its name is withdrawn. An exception that escapes from `run()` or a spawned coroutine is reported with the
/// component's name and follows the failure policy it was started with.
class component : public runnable {
public:
    component();
    ~component() override;

    /// Where it is found: "atirma/boat". Empty for an anonymous one.
    const std::string& path() const noexcept;
    /// The world of its node.
    environment& env() const noexcept;
    /// Where it runs. Only once it was started, as all that follows.
    loop& on() const noexcept;
    /// Of its loop, for Asio's own operations.
    asio::any_io_executor get_executor() const;
    /// Logs with its path, to the sink of its node.
    const logger& log() const noexcept;
    /// Where it is in its life. On its loop; from elsewhere see `node::components()`.
    component_state state() const noexcept;
    /// What serves it, for the layers below and for looking at counts: <ise/service/service_host.hpp>.
    service_host& services() const noexcept;

    // --- what it provides ---------------------------------------------------------------------------------------

    /// Answers the requests of a service by `handler`, which is `ise::task<Response>(Request)` or `Response(Request)`,
    /// with an optional second parameter `const ise::call_context&`. Until it stops, or `withdraw`.
    /// Throws errc::invalid_argument if the name is taken.
    template <class Contract, class Handler>
    void provide(const Contract& service, Handler handler, serve_options options = serve_options()) {
        add(make_call_service(service_parts(), service, std::move(handler), options));
    }
    /// The same for handlers of which one runs at a time.
    template <class Contract, class Handler>
    void provide_exclusive(const Contract& service, Handler handler) {
        serve_options one;
        one.concurrent = 1;
        provide(service, std::move(handler), one);
    }
    /// A subscription service: call the result to publish.
    template <class Contract>
    publication<Contract> publish(const Contract& service, publication_callbacks<Contract> callbacks = publication_callbacks<Contract>()) {
        auto core = make_publication(service_parts(), service, std::move(callbacks));
        add(core);
        return publication<Contract>(core);
    }
    // Mistakes of the kind of a service.
    template <class... Packets, class Handler>
    void provide(const subscription<Packets...>&, Handler&&, serve_options = serve_options()) {
        static_assert(detail::never<Packets...>, "ise: this service is a subscription, which is published: auto out = publish(service)");
    }
    template <class... Packets>
    void publish(const request_response<Packets...>&) {
        static_assert(detail::never<Packets...>, "ise: this service is a request-response, which is provided: provide(service, handler)");
    }

    /// Publishes what `make()` returns, now and every `period` until the component stops. A loop that was held up
    /// publishes once and goes on in step: times that have passed are not made up for.
    /// Throws errc::invalid_argument for a period that is none.
    template <class Contract, class Make>
    void publish_every(const Contract& service, duration period, Make make) {
        using packet_type = typename Contract::packet_type;
        if constexpr (std::is_invocable_r_v<packet_type, Make&>) {
            check_period(period);
            spawn(std::string(service.name()), tick(publish(service), period, std::function<packet_type()>(std::move(make))));
        } else {
            static_assert(detail::never<Make>, "ise: publish_every takes a function without arguments that returns a packet of the service");
        }
    }
    /// Ends a provided service.
    template <class Contract>
    void withdraw(const Contract& service) {
        withdraw_service(std::string(service.name()));
    }
    /// Serves a role beside its own name, or changes its priority there (the highest is preferred); `leave_role` ends it,
    /// and handles go on with the next member. The name server is told at once.
    void serve_role(const std::string& role, std::int32_t priority = 0);
    void leave_role(const std::string& role); ///< see `serve_role`
    /// Whether its name is granted and its lease holds, as far as this side knows. While the name server cannot be
    /// reached, or has no room, the name is unconfirmed: sessions go on, but another may be granted it.
    bool name_confirmed() const;
    /// Declares a service of another component that this one needs: without a provider it cannot do its work, and `ise doctor`
    /// reports that. Services that are called or subscribed to are shown without being declared.
    template <class Contract>
    void require(const Contract& service) {
        declare_required(std::string(service.name()), Contract::types());
    }

    // --- whom it talks to ---------------------------------------------------------------------------------------

    /// The component at `path`, as soon as it is there; errc::no_such_name or errc::name_server_lost after `wait` (default: no
    /// limit). A wait of more than 3 s is logged, and shown by `ise list`, `describe` and `doctor`.
    /// A role is found like a name: the handle talks to the best member that lives, goes on with the next one when that
    /// is lost, and comes back as `how` says. Subscriptions go on with the next member after a gap of unknown length;
    /// a call goes to it unless a byte of it was written already (peer_lost, unknown).
    task<remote> find(std::string path, duration wait = duration::max());
    task<remote> find(std::string path, role_options how, duration wait = duration::max()); ///< the same
    /// The component at `path`, whether it is there now or not: calls wait for it within their deadline.
    remote at(const std::string& path, role_options how = role_options());
    /// The component at `path` where it listens; with an empty path whoever listens there.
    remote at(const endpoint& where, const std::string& path = std::string());
    /// The one whose call is being answered, for calling back over the same session.
    remote caller(const call_context& context);

    /// Subscribes with a callback: `on_packet(const Packet&)` for every packet, in order, on the component's loop, until
    /// the provider withdraws the service. Waits for a provider that is not there as long as it takes; a refusal, or what
    /// the callback throws, follows the failure policy.
    template <class Contract, class Callback>
    void listen(remote provider, const Contract& service, Callback on_packet, subscribe_options options = subscribe_options()) {
        spawn(std::string(service.name()), each(std::move(provider), service, std::function<void(const typename Contract::packet_type&)>(std::move(on_packet)), options));
    }

    // --- its own flow -------------------------------------------------------------------------------------------

    /// Starts a coroutine that the component owns: cancelled and waited for when it stops.
    void spawn(std::string name, task<> body);
    /// Suspends for `length`, on the clock of the environment. Cancellation: terminal, throws `operation_aborted`.
    task<> sleep(duration length) { return sleep_for(on(), length); }
    /// Suspends until `at`; a time that has passed lets others run once.
    task<> sleep_till(time_point at) { return sleep_until(on(), at); }
    /// The monotonic clock; one time within a turn of the loop.
    time_point now() const { return on().now(); }
    /// Civil time, UTC.
    wall_time wall() const { return env().wall(); }
    /// Runs `work` on another thread and waits: for what computes long. Its exception is thrown here. `work` may refer
    /// to the coroutine's variables: cancellation does not interrupt it, and takes effect at the next suspension.
    template <class Work>
    task<std::invoke_result_t<Work&>> offload(Work work) {
        return offload_on(std::move(work));
    }

    /// Call it in the constructor: the component is then found under its name only after `ready()`, and not already
    /// when `run()` suspends for the first time.
    void announce_when_ready() noexcept { announce_when_ready_ = true; }
    /// Completes when the component can be found by name (or at once if it has none, or there is no name server now).
    task<> ready();
    /// Asks the component to stop; it does so soon.
    void stop();

    // --- from other threads -------------------------------------------------------------------------------------

    /// Runs a coroutine on the component's loop and blocks the calling thread until it is done; throws what it throws.
    /// errc::cancelled if the component stops meanwhile or has stopped; errc::would_block_self on the component's own
    /// loop, and in the virtual world, where nothing may block.
    template <class T>
    T wait(task<T> body) {
        check_may_block();
        blocking_outcome<T> made;
        auto outcome = made.other_end();
        post_spawn("wait", fulfil<T>(std::move(body), std::move(made)));
        try {
            return outcome.get();
        } catch (...) {
            throw_outcome(std::current_exception());
        }
    }

protected:
    /// The component's own flow. Returning ends the flow, not the component: what it provides goes on until it is
    /// stopped.
    task<> run() override = 0;

    /// Another component holds the name now, under a higher epoch (errc::superseded). Called on the loop, once; its
    /// sessions are ending with that error and no new ones are made. The component stops as failed, unless this is
    /// overridden: then it goes on without a name, serving nobody, until `stop()`.
    void on_name_lost(const failure& why) override;

private:
    service_runtime& service_parts() const noexcept;
    void add(std::shared_ptr<call_service> service);
    void add(std::shared_ptr<publication_core> service);
    void withdraw_service(const std::string& name);
    void declare_required(const std::string& name, const packet_types& types);
    void check_may_block() const;
    static void check_period(duration period);
    /// Starts a coroutine of the flow from any thread; it is destroyed unstarted if the component stops.
    void post_spawn(std::string name, task<> body);
    /// Makes what a coroutine of a stopped component throws a clear error.
    [[noreturn]] void throw_outcome(const std::exception_ptr& thrown) const;
    /// Whether a subscription that was not made is worth another try.
    static bool keeps_trying(const failure& why) noexcept;
    task<> run_elsewhere(unique_function<void()> job);

    template <class Contract>
    task<> tick(publication<Contract> out, duration period, std::function<typename Contract::packet_type()> make) {
        for (auto at = now();;) {
            co_await sleep_till(at);
            out(make());
            at = saturating_add(at, period);
            if (at < now()) at += ((now() - at) / period + 1) * period;
        }
    }
    template <class Contract>
    task<> each(remote provider, Contract service, std::function<void(const typename Contract::packet_type&)> on_packet, subscribe_options options) {
        stream_of<Contract> packets;
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
    task<std::invoke_result_t<Work&>> offload_on(Work work) {
        using value = std::invoke_result_t<Work&>;
        if constexpr (std::is_void_v<value>) {
            unique_function<void()> job = [&work] { work(); };
            co_await run_elsewhere(std::move(job));
        } else {
            std::optional<value> made;
            unique_function<void()> job = [&] { made.emplace(work()); };
            co_await run_elsewhere(std::move(job));
            co_return std::move(*made);
        }
    }
};

} // namespace ise
