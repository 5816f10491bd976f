#include <ise/session/service_runtime.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

service_runtime::service_runtime(environment& env, loop& on, task_scope& scope, wire::identity self,
                                 service_options options, logger log)
    : env_(env), on_(on), scope_(scope), self_(std::move(self)), options_(options), log_(std::move(log)) {}

std::string service_runtime::name_for_people() const {
    return self_.path.empty() ? "an unnamed component" : fmt::format("'{}'", self_.path);
}

void service_runtime::tell(peer_trouble kind, std::string_view what, std::string_view peer) {
    auto left_out = troubles_[static_cast<std::size_t>(kind)].admit(on_.now());
    if (!left_out) return;
    auto level = kind == peer_trouble::rejected ? log_level::info : log_level::warning;
    log_.write(level, what, {{"peer", std::string(peer)}, {"left_out", std::to_string(*left_out)}});
}

void service_runtime::on_subscription_ended(const std::string& service, const std::string& provider,
                                            const failure& why) {
    constexpr std::size_t most = 16;
    tell(peer_trouble::over, fmt::format("the subscription to '{}' has ended: {}", service, why.message()), provider);
    on_subscribed(service, provider);
    if (ended_subscriptions_.size() >= most) ended_subscriptions_.pop_front();
    ended_subscription ended;
    ended.service = service;
    ended.provider = provider;
    ended.cause = why.message();
    ended_subscriptions_.push_back(std::move(ended));
}

void service_runtime::on_subscribed(const std::string& service, const std::string& provider) {
    std::erase_if(ended_subscriptions_,
                  [&](const auto& one) { return one.service == service && one.provider == provider; });
}

} // namespace ise
