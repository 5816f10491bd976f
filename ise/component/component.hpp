#pragma once
#include <ise/component/introspection.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log.hpp>
#include <ise/core/sleep.hpp>
#include <ise/core/task.hpp>
#include <ise/service/provide.hpp>
#include <ise/service/publication.hpp>
#include <ise/service/remote.hpp>

#include <asio/co_spawn.hpp>
#include <asio/use_future.hpp>

#include <functional>
#include <memory>
#include <string>

namespace ise {

class component_runner;

enum class component_state : std::uint8_t { starting, ready, stopping, stopped, failed };

std::string_view name_of(component_state state) noexcept;

/// An active object: a flow of execution of its own (`run()`), the services it provides, and the services of others
/// that it uses. Derive from it, or give a coroutine to `node::start`.
///
/// Everything of a component runs on its loop; handlers and `run()` interleave at `co_await`. When it is stopped, its
/// coroutines are cancelled at their next suspension (`operation_aborted` is thrown there), its sessions say goodbye,
/// and its name is withdrawn. An exception that escapes from `run()` or a spawned coroutine is reported with the
/// component's name and follows the failure policy it was started with.
class component {
public:
    component();
    virtual ~component();
    component(const component&) = delete;
    component& operator=(const component&) = delete;

    /// Where it is found: "atirma/boat". Empty for an anonymous one.
    const std::string& path() const noexcept;
    environment& env() const noexcept;
    loop& on() const noexcept;
    asio::any_io_executor get_executor() const;
    const logger& log() const noexcept;
    component_state state() const noexcept;
    service_host& services() const noexcept;

    // --- what it provides ---------------------------------------------------------------------------------------

    /// Answers the requests of a service by `handler`, which is `ise::task<Response>(Request)` or `Response(Request)`,
    /// with an optional second parameter `const ise::call_context&`. Until it stops, or `withdraw`.
    /// Throws errc::invalid_argument if the name is taken.
    template <class Contract, class Handler>
    void provide(const Contract& service, Handler handler, serve_options options = serve_options()) {
        add(make_call_service(services(), service, std::move(handler), options));
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
        auto core = make_publication(services(), service, std::move(callbacks));
        add(core);
        return publication<Contract>(core);
    }
    /// Publishes what `make()` returns, every `period`, until the component stops.
    template <class Contract, class Make>
    void publish_every(const Contract& service, duration period, Make make) {
        spawn(std::string(service.name()), tick(publish(service), period, std::function<typename Contract::packet_type()>(std::move(make))));
    }
    /// Ends a provided service.
    template <class Contract>
    void withdraw(const Contract& service) {
        withdraw_service(std::string(service.name()));
    }
    /// Says which service of another component this one needs; visible to whoever describes it.
    template <class Contract>
    void require(const Contract& service) {
        declare_required(std::string(service.name()), Contract::types());
    }

    // --- whom it talks to ---------------------------------------------------------------------------------------

    /// The component at `path`, as soon as it is there; errc::no_such_name or errc::name_server_lost after `wait`.
    task<remote> find(std::string path, duration wait = std::chrono::seconds(10));
    /// The component at `path`, whether it is there now or not: calls wait for it within their deadline.
    remote at(const std::string& path);
    /// Whoever listens at an endpoint.
    remote at(const endpoint& where);
    /// The one whose call is being answered, for calling back over the same session.
    remote caller(const call_context& context);

    /// Subscribes with a callback: `on_packet(const Packet&)` for every packet, in order, on the component's loop.
    template <class Contract, class Callback>
    void listen(remote provider, const Contract& service, Callback on_packet, subscribe_options options = subscribe_options()) {
        spawn(std::string(service.name()), each(std::move(provider), service, std::function<void(const typename Contract::packet_type&)>(std::move(on_packet)), options));
    }

    // --- its own flow -------------------------------------------------------------------------------------------

    /// Starts a coroutine that the component owns: cancelled and waited for when it stops.
    void spawn(std::string name, task<> body);
    task<> sleep(duration length) { return sleep_for(on(), length); }
    task<> sleep_till(time_point at) { return sleep_until(on(), at); }
    time_point now() const { return on().now(); }
    wall_time wall() const { return env().wall(); }
    /// Runs `work` on another thread and waits: for what computes long. Its exception is thrown here.
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

    /// Runs a coroutine on the component's loop and blocks the calling thread until it is done.
    /// errc::would_block_self on the component's own loop, and in the virtual world, where nothing may block.
    template <class T>
    T wait(task<T> body) {
        check_may_block();
        return asio::co_spawn(get_executor(), std::move(body), asio::use_future).get();
    }

protected:
    /// The component's own flow. Returning ends the flow, not the component: what it provides goes on until it is
    /// stopped.
    virtual task<> run() = 0;

private:
    friend class component_runner;

    void add(std::shared_ptr<call_service> service);
    void add(std::shared_ptr<publication_core> service);
    void withdraw_service(const std::string& name);
    void declare_required(const std::string& name, const packet_types& types);
    void check_may_block() const;

    template <class Contract>
    task<> tick(publication<Contract> out, duration period, std::function<typename Contract::packet_type()> make) {
        for (auto at = now();; at += period) {
            co_await sleep_till(at);
            out(make());
        }
    }
    template <class Contract>
    task<> each(remote provider, Contract service, std::function<void(const typename Contract::packet_type&)> on_packet, subscribe_options options) {
        auto packets = co_await provider.subscribe(service, options);
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
            on_packet(*packet);
        }
    }
    template <class Work>
    task<std::invoke_result_t<Work&>> offload_on(Work work) {
        using value = std::invoke_result_t<Work&>;
        auto done = std::make_shared<offloaded<value>>(on());
        env().offload([done, job = std::make_shared<Work>(std::move(work)), executor = get_executor()] {
            done->run(*job);
            asio::post(executor, [done] {
                done->finished = true;
                done->wake.resume();
            });
        });
        while (!done->finished) co_await done->wake.wait();
        co_return done->take();
    }
    template <class T>
    struct offloaded {
        explicit offloaded(loop& on) : wake(on, [this] { wake.resume(); }) {}
        template <class Work>
        void run(Work& job) {
            try {
                if constexpr (std::is_void_v<T>) {
                    job();
                } else {
                    value.emplace(job());
                }
            } catch (...) {
                thrown = std::current_exception();
            }
        }
        T take() {
            if (thrown) std::rethrow_exception(thrown);
            if constexpr (!std::is_void_v<T>) return std::move(*value);
        }
        waiter<> wake;
        std::optional<std::conditional_t<std::is_void_v<T>, std::monostate, T>> value;
        std::exception_ptr thrown;
        bool finished = false;
    };

    component_runner* runner_ = nullptr; // before it is started there is none
    bool announce_when_ready_ = false;
};

} // namespace ise
