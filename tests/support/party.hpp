#pragma once
#include <ise/asio.hpp>
#include <ise/call/provide.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/sleep.hpp>
#include <ise/service/remote.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/subscription/publication.hpp>

#include <asio/bind_cancellation_slot.hpp>

#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise_test {

/// The services of one component on a loop, as the layers above would hold them: what tests of calls and
/// subscriptions talk through.
struct party {
    party(ise::environment& environment, std::unique_ptr<ise::loop_host> loop_of, std::string path,
          ise::service_options options = {}, ise::security credentials = {})
        : env(environment), host(std::move(loop_of)), on(host->loop()),
          scope(on, [this](const std::string& name, std::exception_ptr thrown) {
              escaped.push_back(name + ": " + ise::describe(thrown));
          }) {
        ise::wire::identity self;
        self.path = path;
        self.host_name = env.identity().host_name;
        self.process_key = env.identity().process_key;
        self.incarnation = env.random() | 1;
        auto sink = [this](const ise::log_record& record) {
            if (record.level >= ise::log_level::warning) warnings.emplace_back(record.message);
        };
        services.emplace(env, on, scope, self, options, ise::logger(env, path, sink), std::move(credentials));
    }

    template <class Contract, class Handler>
    void provide(const Contract& contract, Handler handler, ise::serve_options options = ise::serve_options()) {
        services->services().add(ise::make_call_service(*services, contract, std::move(handler), options)).value();
    }
    template <class Contract>
    ise::publication<Contract> publish(const Contract& contract, ise::publication_callbacks<Contract> callbacks = {}) {
        auto core = ise::make_publication(*services, contract, std::move(callbacks));
        services->services().add(core).value();
        return ise::publication<Contract>(core);
    }
    ise::endpoint listen(const std::string& at) { return services->listen(ise::endpoint::parse(at).value()).value(); }
    ise::remote at(const ise::endpoint& where) { return ise::remote(services->link_to(where)); }
    ise::remote at(const std::string& where) { return at(ise::endpoint::parse(where).value()); }

    ise::environment& env;
    std::unique_ptr<ise::loop_host> host;
    ise::loop& on;
    std::vector<std::string> escaped;  ///< exceptions that nobody caught
    std::vector<std::string> warnings; ///< logged
    ise::task_scope scope;
    std::optional<ise::service_host> services;
};

/// What became of a coroutine that a test started.
template <class T>
struct started {
    bool done = false;
    std::optional<T> value;
    std::exception_ptr thrown;
    asio::cancellation_signal cancel;

    /// The value, or throws what the coroutine threw.
    T& get() {
        if (thrown) std::rethrow_exception(thrown);
        return value.value();
    }
    /// The code of the ise::error that was thrown.
    ise::errc code() const {
        if (!thrown) return ise::errc{};
        try {
            std::rethrow_exception(thrown);
        } catch (const ise::error& known) {
            return known.code();
        } catch (const std::exception&) {
            return ise::is_cancellation(thrown) ? ise::errc::cancelled : ise::errc{};
        }
    }
};
template <>
struct started<void> {
    bool done = false;
    std::exception_ptr thrown;
    asio::cancellation_signal cancel;
    void get() {
        if (thrown) std::rethrow_exception(thrown);
    }
};

/// Starts a coroutine on a loop; its outcome lies in what is returned, which the coroutine keeps alive.
template <class T>
std::shared_ptr<started<T>> start(ise::loop& on, ise::task<T> body) {
    auto state = std::make_shared<started<T>>();
    if constexpr (std::is_void_v<T>) {
        auto finished = [state](std::exception_ptr thrown) {
            state->thrown = thrown;
            state->done = true;
        };
        ise::async_run(on.get_executor(), std::move(body),
                       asio::bind_cancellation_slot(state->cancel.slot(), std::move(finished)));
    } else {
        auto wrapped = [](std::shared_ptr<started<T>> into, ise::task<T> inner) -> ise::task<> {
            auto value = co_await std::move(inner);
            into->value.emplace(std::move(value));
        };
        auto finished = [state](std::exception_ptr thrown) {
            state->thrown = thrown;
            state->done = true;
        };
        ise::async_run(on.get_executor(), wrapped(state, std::move(body)),
                       asio::bind_cancellation_slot(state->cancel.slot(), std::move(finished)));
    }
    return state;
}

} // namespace ise_test
