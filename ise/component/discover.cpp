#include <ise/component/discover.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

result<dynamic_contract> contract_of(const service_info& message) {
    if (message.kind > static_cast<std::uint8_t>(service_kind::subscription))
        return failure(errc::malformed,
                       fmt::format("'{}' is a service of an unknown kind ({})", message.name, message.kind));
    auto kind = static_cast<service_kind>(message.kind);
    std::vector<std::string> texts;
    for (const auto& packet : message.packets) texts.push_back(packet.schema);
    return dynamic_contract::parse(message.name, kind, texts);
}

task<result<dynamic_contract>> discover(remote provider, std::string service, duration deadline) {
    describe_request question;
    auto response = co_await provider.try_call(describe_service, question, deadline);
    if (!response) co_return response.error();
    std::string known;
    for (const auto& one : response->services) {
        if (!one.provided) continue;
        if (one.name == service) co_return contract_of(one);
        if (!one.name.starts_with("ise.")) known += (known.empty() ? "" : ", ") + one.name;
    }
    co_return failure(errc::no_such_service, fmt::format("{} provides no service '{}'; it provides {}", provider.name(),
                                                         service, known.empty() ? "none" : known));
}

task<result<bool>> provides(remote provider, std::string service, duration deadline) {
    describe_request question;
    auto response = co_await provider.try_call(describe_service, question, deadline);
    if (!response) co_return response.error();
    co_return std::ranges::any_of(response->services,
                                  [&](const service_info& one) { return one.provided && one.name == service; });
}

} // namespace ise
