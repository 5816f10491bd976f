#include <ise/service/dynamic_provider.hpp>

#include <ise/call/provide.hpp>
#include <ise/core/error.hpp>
#include <ise/service/fitted_bytes.hpp>
#include <ise/session/service_runtime.hpp>

#include <fmt/format.h>

#include <exception>
#include <optional>
#include <string>
#include <utility>

namespace ise {
namespace {

std::shared_ptr<const packet_types> kept_types(service_runtime& runtime, const dynamic_contract& service,
                                               service_kind wanted) {
    if (service.kind() != wanted)
        throw error(errc::invalid_argument,
                    fmt::format("'{}' is a {} service: {}", service.name(), name_of(service.kind()),
                                wanted == service_kind::subscription ? "provide it (provide_dynamic)"
                                                                     : "publish it (publish_dynamic)"));
    return runtime.schemas().keep(service.types()).value();
}

dynamic_packet packet_of(const schema& type, bytes_view raw) { return {type, bytes(raw.begin(), raw.end())}; }

// A response that does not fit is the handler's fault, and it ran.
[[noreturn]] void throw_unfit(const std::string& service, const error& why) {
    throw error(errc::handler_failed, fmt::format("the response of '{}' does not fit: {}", service, why.what()),
                execution::unknown);
}

class dynamic_coroutine_service final : public call_service {
public:
    dynamic_coroutine_service(service_runtime& runtime, std::string name, std::shared_ptr<const packet_types> types,
                              serve_options options, dynamic_handler handler)
        : call_service(runtime, std::move(name), *types, options), kept_(std::move(types)),
          handler_(std::move(handler)) {}

private:
    class worker final : public call_worker {
    public:
        worker(dynamic_coroutine_service& of, service_runtime& runtime) : call_worker(of, runtime), service_(of) {}

    private:
        void load(incoming_packet& request) override {
            request_.emplace(packet_of(service_.kept_->schemas[role::request], request.bytes()));
        }

        task<> run() override {
            for (;;) {
                bool more = co_await next();
                if (!more) co_return;
                std::optional<failure> problem;
                if (may_begin()) {
                    try {
                        auto handling = service_.handler_(std::move(*request_), context());
                        auto response = co_await std::move(handling);
                        respond(response);
                    } catch (...) {
                        problem = detail::failure_of(std::current_exception());
                    }
                }
                if (problem) answer(*problem);
                // A cancelled call leaves its mark on the coroutine; the next call must not see it.
                co_await this_task::forget_cancellation;
            }
        }

        void respond(const dynamic_packet& response) {
            std::optional<fitted_bytes> body;
            try {
                body.emplace(response, service_.kept_->schemas[role::response]);
            } catch (const error& unfit) {
                throw_unfit(service_.name(), unfit);
            }
            answer(outgoing_packet::of_bytes(body->view()));
        }

        dynamic_coroutine_service& service_;
        std::optional<dynamic_packet> request_;
    };

    std::unique_ptr<call_worker> make_worker() override { return std::make_unique<worker>(*this, runtime()); }

    std::shared_ptr<const packet_types> kept_;
    dynamic_handler handler_;
};

class dynamic_plain_service final : public call_service {
public:
    dynamic_plain_service(service_runtime& runtime, std::string name, std::shared_ptr<const packet_types> types,
                          dynamic_function handler)
        : call_service(runtime, std::move(name), *types), kept_(std::move(types)), handler_(std::move(handler)) {}

private:
    void serve_now(call_origin& from, const incoming_call& call, incoming_packet& came) override {
        auto request = packet_of(kept_->schemas[role::request], came.bytes());
        auto response = handled(from, call, std::move(request));
        if (response) {
            const bytes_view raw(*response);
            from.reply(call.id, outgoing_packet::of_bytes(raw));
        } else {
            tell_failure(from, response.error());
            from.refuse(call.id, response.error());
        }
    }

    result<bytes> handled(const call_origin& from, const incoming_call& call, dynamic_packet request) {
        try {
            call_context context;
            describe(context, from, call);
            auto response = handler_(std::move(request), context);
            if (!response) return response.error();
            try {
                return fitted_bytes(*response, kept_->schemas[role::response]).copy();
            } catch (const error& unfit) {
                throw_unfit(name(), unfit);
            }
        } catch (...) {
            return detail::failure_of(std::current_exception());
        }
    }

    std::shared_ptr<const packet_types> kept_;
    dynamic_function handler_;
};

} // namespace

std::shared_ptr<call_service> make_dynamic_service(service_runtime& runtime, const dynamic_contract& service,
                                                   dynamic_handler handler, serve_options options) {
    auto types = kept_types(runtime, service, service_kind::request_response);
    return std::make_shared<dynamic_coroutine_service>(runtime, service.name(), std::move(types), options,
                                                       std::move(handler));
}

std::shared_ptr<call_service> make_dynamic_service(service_runtime& runtime, const dynamic_contract& service,
                                                   dynamic_function handler) {
    auto types = kept_types(runtime, service, service_kind::request_response);
    return std::make_shared<dynamic_plain_service>(runtime, service.name(), std::move(types), std::move(handler));
}

publication_core& dynamic_publication::core() const {
    if (!core_)
        throw error(errc::invalid_argument, "an empty publication: assign what `publish_dynamic(…)` gave first");
    return *core_;
}

published_packet dynamic_publication::made(const dynamic_packet& packet) const {
    auto& to = core();
    const fitted_bytes raw(packet, type_);
    return to.encoded(current_trace(), raw.view());
}

void dynamic_publication::operator()(const dynamic_packet& packet) const {
    auto& to = core();
    const fitted_bytes raw(packet, type_);
    to.publish(current_trace(), raw.view());
}

void dynamic_publication::publish_if(const dynamic_packet& packet,
                                     function_ref<bool(const subscriber_info&)> wants) const {
    core().publish_to(made(packet), wants);
}

task<> dynamic_publication::send(const dynamic_packet& packet) const {
    auto ready = made(packet); // also checks that there is a core
    return publication_core::send_when_room(core_, std::move(ready));
}

bool dynamic_publication::try_send(const dynamic_packet& packet) const {
    if (!core().has_room()) return false;
    (*this)(packet);
    return true;
}

void dynamic_publication::end(const failure& why) const { core().stop(why); }

std::size_t dynamic_publication::subscribers() const { return core().subscribers(); }
std::uint64_t dynamic_publication::published() const { return core().published(); }

std::shared_ptr<publication_core> make_dynamic_publication(service_runtime& runtime, const dynamic_contract& service,
                                                           dynamic_callbacks callbacks) {
    auto types = kept_types(runtime, service, service_kind::subscription);
    auto made = std::make_shared<publication_core>(runtime, service.name(), *types);
    auto read = [](const schema& type, bytes_view raw, const adapter* adapt) {
        if (raw.empty()) return default_packet(type); // nobody said anything
        return adapt ? dynamic_packet(type, (*adapt)(raw)) : packet_of(type, raw);
    };
    made->accept = [types, read, decide = std::move(callbacks.on_subscribe)](
                       bytes_view raw, const adapter* adapt, const subscriber_info& who) -> result<bytes> {
        auto request = read(types->schemas[role::subscribe_request], raw, adapt);
        const auto& wanted = types->schemas[role::subscribe_response];
        if (!decide) {
            auto response = default_packet(wanted);
            return fitted_bytes(response, wanted).copy();
        }
        auto response = decide(request, who);
        if (!response) return response.error();
        return fitted_bytes(*response, wanted).copy();
    };
    made->removed = [types, read, tell = std::move(callbacks.on_unsubscribe)](bytes_view raw, const adapter* adapt,
                                                                              const subscriber_info& who) {
        const auto& wanted = types->schemas[role::unsubscribe_response];
        auto request = read(types->schemas[role::unsubscribe_request], raw, adapt);
        auto response = tell ? tell(request, who) : default_packet(wanted);
        return fitted_bytes(response, wanted).copy();
    };
    return made;
}

} // namespace ise
