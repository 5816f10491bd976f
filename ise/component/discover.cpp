#include <ise/component/discover.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

result<dynamic_contract> contract_of(const service_text& told) {
    if (told.kind > static_cast<std::uint8_t>(service_kind::subscription))
        return failure(errc::malformed, fmt::format("'{}' is a service of an unknown kind ({})", told.name, told.kind));
    auto kind = static_cast<service_kind>(told.kind);
    std::vector<std::string> texts;
    for (const auto& packet : told.packets) texts.push_back(packet.schema);
    return dynamic_contract::parse(told.name, kind, texts);
}

task<result<dynamic_contract>> discover(remote provider, std::string service, duration deadline) {
    describe_request question;
    auto told = co_await provider.try_call(describe_service, question, deadline);
    if (!told) co_return told.error();
    std::string known;
    for (const auto& one : told->services) {
        if (!one.provided) continue;
        if (one.name == service) co_return contract_of(one);
        if (!one.name.starts_with("ise.")) known += (known.empty() ? "" : ", ") + one.name;
    }
    co_return failure(errc::no_such_service, fmt::format("{} provides no service '{}'; it provides {}", provider.name(),
                                                         service, known.empty() ? "none" : known));
}

task<result<bool>> provides(remote provider, std::string service, duration deadline) {
    describe_request question;
    auto told = co_await provider.try_call(describe_service, question, deadline);
    if (!told) co_return told.error();
    co_return std::ranges::any_of(told->services,
                                  [&](const service_text& one) { return one.provided && one.name == service; });
}

} // namespace ise
